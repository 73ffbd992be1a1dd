"""Residual tests in the form of the field: auto-correlation of the residual, its cross-correlation with the drive."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.fft import irfft, next_fast_len, rfft
from scipy.stats import norm

from ...errors import RecordError

Array = NDArray[np.float64]

FALSE_ALARMS = 0.01
"""Chance that any lag of an independent residual lies beyond the bounds: they hold for all lags together."""

CAPTION = (
    "An output-error model is judged by the cross-correlation: beyond its bounds, something that the drive does is not "
    "in the model. Auto-correlation beyond its bounds tells as well of a sensor whose noise is coloured."
)
"""How to read the test of whiteness."""


@dataclass(frozen=True, eq=False, slots=True)
class Correlation:
    """Correlations of a residual e with itself and with the drive u, normalised to 1.

    Parameters
    ----------
    lag : (k + 1,) ndarray
        Lags of the auto-correlation [s], from 0.
    auto : (k + 1,) ndarray
        Auto-correlation of e.
    auto_bound : float
        99 % bound for white noise, z/√n.
    cross_lag : (2k + 1,) ndarray
        Lags of the cross-correlation [s]; positive where e follows u.
    cross : (2k + 1,) ndarray
        Cross-correlation of e(t + lag) with u(t).
    cross_bound : float
        99 % bound for an e of the same colour that does not depend on u, z·√(Σ ρ_e ρ_u / n).
    """

    lag: Array
    auto: Array
    auto_bound: float
    cross_lag: Array
    cross: Array
    cross_bound: float

    @property
    def is_white(self) -> bool:
        """True where no lag of the auto-correlation but 0 lies beyond the bound."""
        return bool(np.all(np.abs(self.auto[1:]) <= self.auto_bound))

    @property
    def is_independent(self) -> bool:
        """True where no lag of the cross-correlation lies beyond the bound."""
        return bool(np.all(np.abs(self.cross) <= self.cross_bound))


def correlate(residual: Array, voltage: Array, sample_period: float, lags: int = 50) -> Correlation:
    """Auto- and cross-correlation of a residual with 99 % bounds.

    Parameters
    ----------
    residual : (n,) ndarray
        Measured minus simulated displacement [m].
    voltage : (n,) ndarray
        Drive [V].
    sample_period : float
        Time between samples [s].
    lags : int
        Largest lag [samples]; at most a quarter of the record is used.

    Raises
    ------
    RecordError
        If drive or residual is constant, or there are fewer than 16 samples.

    Notes
    -----
    Ljung, *System Identification*, 2nd ed., Sec. 16.6. The sum over the colours is taken over all lags, as the product
    of the two spectra (Bartlett). z is the normal quantile of 1 % shared by all lags (Bonferroni). A drive of one
    frequency has a bound near or above 1: it decides nothing.
    """
    n = residual.size
    if n < 16:
        raise RecordError(f"correlation: got {n} samples, expected at least 16")
    e, u = residual - residual.mean(), voltage - voltage.mean()
    power_e, power_u = float(e @ e), float(u @ u)
    if power_e == 0.0 or power_u == 0.0:
        raise RecordError("correlation: got a constant drive or residual, expected both to change")
    lags = min(lags, n // 4)
    length = next_fast_len(2 * n, real=True)
    spectrum_e, spectrum_u = rfft(e, length), rfft(u, length)
    auto_e = irfft(np.abs(spectrum_e) ** 2, length) / power_e
    auto_u = irfft(np.abs(spectrum_u) ** 2, length) / power_u
    both = irfft(spectrum_e * np.conj(spectrum_u), length) / np.sqrt(power_e * power_u)
    k = np.arange(-lags, lags + 1)
    return Correlation(
        lag=np.asarray(sample_period * np.arange(lags + 1)),
        auto=auto_e[: lags + 1],
        auto_bound=float(norm.isf(FALSE_ALARMS / 2 / lags) / np.sqrt(n)),
        cross_lag=np.asarray(sample_period * k),
        cross=both[k],
        cross_bound=float(norm.isf(FALSE_ALARMS / 2 / k.size)) * float(np.sqrt(max(auto_e @ auto_u, 0.0) / n)),
    )
