# Copyright 2026 piezo_hysteresis maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Standard residual tests: auto-correlation of the residual, and its cross-correlation with the drive."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy
from scipy.fft import irfft, next_fast_len, rfft
from scipy.linalg import solve_toeplitz

from ..blocks.block import Array
from ..errors import RecordError

FALSE_ALARMS = 0.01
"""Probability that any lag of an independent residual exceeds the bounds; it applies to all lags together."""

LONGEST_MEMORY, SHARE_OF_MEMORY = 40, 20
"""Highest order of the autoregression of the residual, and smallest number of samples per coefficient."""
FEWEST_INDEPENDENT = 20.0
"""Effective number of samples, and of those in which the drive moves, below which a cross-correlation is not tested."""
FEWEST_DIRECTIONS = 5.0
"""Order of persistent excitation of the filtered drive below which a small cross-correlation proves nothing.

A sum of m sines has order 2m. The filter that makes the residual white removes so few frequencies, and with them
whatever follows the drive.
"""
PREDICTABLE = 1e-9
"""Share of the residual's power below which its innovations are rounding errors: the residual is a sum of few sines."""

CAPTION = (
    "The cross-correlation judges the model. If it exceeds its bounds, the residual depends on "
    "the drive, and something is missing in the model. If only the auto-correlation exceeds "
    "its bounds, the noise of the sensor may be coloured. For the cross-correlation, residual "
    "and drive pass the filter that makes the residual white. Undecided means that this test says "
    "nothing: the drive has too few frequencies, as a sine or a triangle, or it moves in too few samples, as a step, "
    "or the record is too short."
)
"""Explanation of the test of whiteness."""


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
        Cross-correlation of e'(t + lag) with u'(t), both filtered by the autoregression that makes e white.
    cross_bound : float
        99 % bound for an e that does not depend on u, from the effective number of samples.
    effective_samples : float
        Number of independent samples that contain the same information as the n samples, n/Σ ρ_e' ρ_u'.
    excitation_order : float
        Effective order of persistent excitation of u', m²/Σ ρ_u'² over an m × m correlation matrix; infinite if e is
        white without a filter, because then a drive of any frequencies would colour it.
    moving_samples : float
        Effective number of samples in which u' is large, (Σ u'²)²/Σ u'⁴; infinite if e is white without a filter. A
        step before the first sample, or a rest with a few samples of motion, shows the test nothing of what follows.
    """

    lag: Array
    auto: Array
    auto_bound: float
    cross_lag: Array
    cross: Array
    cross_bound: float
    effective_samples: float
    excitation_order: float
    moving_samples: float

    @property
    def decides(self) -> bool:
        """False if the drive has too few frequencies or moves too little, or the residual is too small."""
        enough = min(self.effective_samples, self.moving_samples) >= FEWEST_INDEPENDENT
        return (enough and self.excitation_order >= FEWEST_DIRECTIONS) or not self.is_independent

    @property
    def is_white(self) -> bool:
        """True if the auto-correlation exceeds its bound at lag 0 only."""
        return bool(np.all(np.abs(self.auto[1:]) <= self.auto_bound))

    @property
    def is_independent(self) -> bool:
        """True if the cross-correlation exceeds its bound at no lag."""
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
    Ljung, *System Identification*, 2nd ed., Sec. 16.6, with pre-whitening (Box and Jenkins, *Time Series Analysis*,
    Sec. 11.2): a slow residual and a slow drive can correlate by chance, their innovations do not. The remaining
    correlations enter as a sum over all lags, computed from the product of the two spectra (Bartlett). The bound is
    tanh(z/√(n' − 3)) (Fisher), with the normal quantile z of 1 % divided among all lags (Bonferroni) and the effective
    number n' of samples.
    """
    n = residual.size
    if n < 16:
        raise RecordError(f"correlation: got {n} samples, expected at least 16")
    e, u = residual - residual.mean(), voltage - voltage.mean()
    power_e, power_u = float(e @ e), float(u @ u)
    if power_e == 0.0 or power_u == 0.0:
        raise RecordError("correlation: got a constant drive or residual, expected both to change")
    lags = min(lags, n // 4)
    auto, _, _ = _products(e, e)
    memory = autoregression(auto / power_e, n)
    innovations, drive = (scipy.signal.lfilter(memory, [1.0], x)[memory.size - 1 :] for x in (e, u))
    both, auto_e, auto_u = _products(innovations, drive)
    power = float(auto_e[0] * auto_u[0])
    k = np.arange(-lags, lags + 1)
    z = float(scipy.stats.norm.isf(FALSE_ALARMS / 2 / k.size))
    if auto_e[0] <= PREDICTABLE * power_e or auto_u[0] <= PREDICTABLE * power_u:
        cross, effective, order, moves = np.zeros(k.size), 0.0, 0.0, 0.0
    else:
        cross = both[k] / np.sqrt(power)
        effective = innovations.size / max(1.0, float(auto_e @ auto_u) / power)
        order = _order(auto_u[: 2 * min(LONGEST_MEMORY, n // 4)] / auto_u[0]) if memory.size > 1 else np.inf
        moves = float(auto_u[0]) ** 2 / float(np.sum(drive**4)) if memory.size > 1 else np.inf
    return Correlation(
        lag=np.asarray(sample_period * np.arange(lags + 1)),
        auto=auto[: lags + 1] / power_e,
        auto_bound=float(scipy.stats.norm.isf(FALSE_ALARMS / 2 / lags) / np.sqrt(n)),
        cross_lag=np.asarray(sample_period * k),
        cross=cross,
        cross_bound=float(np.tanh(z / np.sqrt(effective - 3.0))) if effective >= FEWEST_INDEPENDENT else 1.0,
        effective_samples=effective,
        excitation_order=order,
        moving_samples=moves,
    )


def autoregression(auto: Array, size: int) -> Array:
    """Filter (p + 1,) that whitens a signal with the given auto-correlation; Schwarz's criterion chooses the order.

    Parameters
    ----------
    auto : (k,) ndarray
        Auto-correlation from lag 0, normalised to 1.
    size : int
        Number of samples from which it was computed.

    Examples
    --------
    >>> autoregression(0.5 ** np.arange(50), 1000).round(3).tolist()
    [1.0, -0.5]
    """
    best, least = np.ones(1), 0.0
    for order in range(1, min(LONGEST_MEMORY, size // SHARE_OF_MEMORY) + 1):
        weights = solve_toeplitz(auto[:order], auto[1 : order + 1])
        left = max(1.0 - float(weights @ auto[1 : order + 1]), np.finfo(float).eps)
        criterion = size * np.log(left) + order * np.log(size)
        if criterion < least:
            best, least = np.concatenate(([1.0], -weights)), criterion
    return best


def _order(auto: Array) -> float:
    """Effective rank (tr R)²/tr R² of the correlation matrix R that has `auto` as its first row."""
    often = 2.0 * (auto.size - np.arange(auto.size))
    often[0] = auto.size
    return float(auto.size**2 / (often @ auto**2))


def _products(first: Array, second: Array) -> tuple[Array, Array, Array]:
    """Circular cross-correlation of `first` and `second` at all lags, and the auto-correlation of each."""
    length = next_fast_len(2 * first.size, real=True)
    a, b = rfft(first, length), rfft(second, length)
    return irfft(a * np.conj(b), length), irfft(np.abs(a) ** 2, length), irfft(np.abs(b) ** 2, length)
