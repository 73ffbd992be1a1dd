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

"""Dynamics as a sum of modes, fitted by output error, for poles that crowd near z = 1.

At 50 kHz the poles of a mode at 500 Hz lie within 0.06 of z = 1. The coefficients of A(z) are then correlated to the
last digits, and noise at high frequencies dominates the fit. A sum of second-order sections avoids both problems. Its
start values are the poles of dynamics identified at a lower rate, mapped back by z → z^(1/q).
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from functools import lru_cache

import numpy as np
import scipy
from numpy.typing import NDArray

from ...errors import IdentificationError
from ..fit.stable_step import LARGEST_POLE
from .dynamics import Dynamics, identify_arx, in_free_run, settling
from .regressors import Signals

Array = NDArray[np.float64]

FACTORS = (4, 16)
"""Ratios of the full rate to the lower ones."""
SHORTEST = 50
"""Smallest number of samples of a record at the lower rate."""
SAMPLES = 60_000
"""Largest number of samples that are fitted."""
SIMULATIONS, CONVERGED = 20, 1e-3
"""Largest number of simulations of a fit, and relative decrease of the squared error at convergence."""
FAST = 0.3
"""Absolute value of the poles with which a section begins that no mode was found for."""
INDEPENDENT = 1e-13
"""Smallest eigenvalue of a determined direction, relative to the largest one."""
AWAY = 1e3
"""Residual that is assigned to unstable sections, as a multiple of the output."""


def identify_modes(
    signals: Signals, delay: int, sample_period: float, orders: tuple[int, int], iterations: int
) -> Dynamics:
    """The best sum of modes, with start values from several lower sampling rates.

    Parameters
    ----------
    signals : sequence of (u, y)
        Input and output of every record.
    delay : int
        d, samples.
    sample_period : float
        Sample period [s].
    orders : (int, int)
        na and nb, equal and even.
    iterations : int
        Largest number of Steiglitz-McBride iterations at a lower rate.

    Raises
    ------
    IdentificationError
        If the orders are invalid, if no record is long enough or shows a mode, or if poles crowd so much that rounded
        coefficients cannot represent them.

    Notes
    -----
    Output error by variable projection (Golub and Pereyra 1973): the numerators follow linearly from the denominators.
    """
    if orders[0] != orders[1] or orders[0] % 2:
        raise IdentificationError(f"modes: got orders {orders}, expected na = nb, an even number")
    few = _beginnings(signals, delay)
    found: list[tuple[float, Array]] = []
    for factor in FACTORS:
        with suppress(IdentificationError):
            sections = _found_at(factor, signals, delay, sample_period, orders, iterations)
            residual = _projected(sections, few)[1]
            found.append((float(residual @ residual), sections))
    if not found:
        raise IdentificationError(f"modes: got no record that shows one, expected {SHORTEST * max(FACTORS)} samples")
    _, sections = min(found, key=lambda f: f[0])
    a, b = _polynomials(*_fitted(sections, few))
    arx = settling(a, b, delay)
    if arx is None:
        raise IdentificationError(
            "modes: got poles so close to each other that coefficients in double precision cannot represent them"
        )
    return in_free_run(Dynamics(arx, sample_period), signals)


def _beginnings(signals: Signals, delay: int) -> Signals:
    """Delayed drive relative to its start, and output without its mean, of the beginnings of the settled records."""
    share = min(1.0, SAMPLES / sum(y.size for _, y in signals))
    cuts = [(u[: int(share * u.size)], y[: int(share * y.size)]) for u, y in signals]
    return [(_delayed(u - u[0], delay), y - y.mean()) for u, y in cuts]


def _found_at(
    factor: int, signals: Signals, delay: int, sample_period: float, orders: tuple[int, int], iterations: int
) -> Array:
    """Denominators (na/2, 2) of the sections, from dynamics identified at a lower rate."""
    slow = [
        (scipy.signal.decimate(u - u[0], factor, ftype="fir"), scipy.signal.decimate(y - y[0], factor, ftype="fir"))
        for u, y in signals
        if y.size >= SHORTEST * factor
    ]
    if not slow:
        raise IdentificationError(f"modes: got no record of {SHORTEST * factor} samples")
    found = identify_arx(slow, max(1, round(delay / factor)), factor * sample_period, orders, iterations)
    poles = found.arx.poles
    modes = poles[poles.imag > 0.0] ** (1.0 / factor)
    if not modes.size:
        raise IdentificationError(f"modes: got none at a rate lower by {factor}, expected a pair of poles")
    # only modes are used, because slow real poles would imitate creep; the other sections are fast and differ, because
    # equal ones have equal slopes, and would stay equal
    others = orders[0] // 2 - modes.size
    fast = FAST * np.exp(1j * np.pi * np.arange(1, others + 1) / (others + 1))
    both = np.concatenate((modes, fast))
    return np.column_stack((-2.0 * both.real, np.abs(both) ** 2))


def _projected(sections: Array, signals: Signals) -> tuple[Array, Array, Array]:
    """The best numerators (k, 2), their residual, and the response of every tap."""
    shaped = [[scipy.signal.lfilter([1.0], [1.0, *a], u) for a in sections] for u, _ in signals]
    basis = _about_means([np.array([_delayed(s, k) for s in one for k in (0, 1)]) for one in shaped])
    scale = np.linalg.norm(basis, axis=1)
    scale[scale == 0.0] = 1.0
    basis /= scale[:, None]
    output = np.concatenate([y for _, y in signals])
    taps = np.linalg.lstsq(basis @ basis.T, basis @ output, rcond=INDEPENDENT)[0]
    return (taps / scale).reshape(-1, 2), output - taps @ basis, basis


def _slopes(sections: Array, numerators: Array, signals: Signals) -> Array:
    """∂y/∂(a1, a2) of every section, shape (2k, n)."""
    both = list(zip(sections, numerators, strict=True))
    twice = [
        [-scipy.signal.lfilter([1.0], [1.0, *a], scipy.signal.lfilter(b, [1.0, *a], u)) for a, b in both]
        for u, _ in signals
    ]
    return _about_means([np.array([_delayed(s, k) for s in one for k in (1, 2)]) for one in twice])


def _about_means(records: Sequence[Array]) -> Array:
    """Rows of all records without their means, concatenated."""
    return np.concatenate([rows - rows.mean(axis=1, keepdims=True) for rows in records], axis=1)


def _delayed(x: Array, samples: int) -> Array:
    return np.concatenate((np.zeros(samples), x[: x.size - samples]))


def _fitted(sections: Array, signals: Signals) -> tuple[Array, Array]:
    """Denominators and numerators with the smallest output error."""
    output = np.concatenate([y for _, y in signals])

    @lru_cache(maxsize=1)  # derivatives are requested at the parameters of the last residual
    def projected(flat: tuple[float, ...]) -> tuple[Array, Array, Array]:
        return _projected(np.reshape(flat, (-1, 2)), signals)

    def residual(flat: Array) -> Array:
        return projected(tuple(flat))[1] if _radius(flat.reshape(-1, 2)) < LARGEST_POLE else AWAY * output

    def slopes(flat: Array) -> Array:
        numerators, _, basis = projected(tuple(flat))
        along = _slopes(flat.reshape(-1, 2), numerators, signals)
        inverse = np.linalg.pinv(basis @ basis.T, rcond=INDEPENDENT, hermitian=True)
        return np.asarray((along @ basis.T @ inverse @ basis - along).T)

    fitted = scipy.optimize.least_squares(
        residual, sections.ravel(), slopes, method="lm", x_scale="jac", ftol=CONVERGED, max_nfev=SIMULATIONS
    )
    return fitted.x.reshape(-1, 2), projected(tuple(fitted.x))[0]


def _radius(sections: Array) -> float:
    return max(float(np.abs(np.roots([1.0, *a])).max(initial=0.0)) for a in sections)


def _polynomials(sections: Array, numerators: Array) -> tuple[Array, Array]:
    """a and b of the sum of the sections."""
    feedbacks = [np.array([1.0, *a]) for a in sections]
    total = np.zeros(2 * len(sections))
    for k, b in enumerate(numerators):
        others = _product([f for j, f in enumerate(feedbacks) if j != k])
        total += np.convolve(b, others)
    return _product(feedbacks)[1:], total


def _product(polynomials: Sequence[Array]) -> Array:
    product = np.ones(1)
    for polynomial in polynomials:
        product = np.convolve(product, polynomial)
    return product
