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

"""Factors of a numerator by the position of its zeros: inside the unit circle, outside, or too close to it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray
from scipy.linalg import convolution_matrix

Array = NDArray[np.float64]

NEGLIGIBLE = 1e-14
"""Coefficients below this share of the largest one are rounding errors."""

INSIDE = 1.0 - 1e-6
"""Zeros of a smaller radius are inverted by a recursion, even if its response decays slowly."""

LONGEST = 2048
"""Largest number of taps of a preview filter."""

ROUNDING = 1e-15
"""Taps at the end of a preview filter are dropped if together they are below this share of the sum of all taps."""

NEAREST = float(np.exp(-np.log(ROUNDING) / LONGEST))
"""Zeros of a larger radius are inverted by preview; between `INSIDE` and this radius the inverse is approximate."""

ORDER = 8
"""Number of terms of the series that corrects the gain of a zero at the unit circle."""


@dataclass(frozen=True, eq=False, slots=True)
class Factors:
    """B(z) = z^(−delay) · inside · outside · near.

    Parameters
    ----------
    delay : int
        Delay in whole samples.
    inside, outside, near : ndarray
        Polynomials in z⁻¹; `inside` also contains the constant factor of B.
    """

    delay: int
    inside: Array
    outside: Array
    near: Array


def factors(numerator: Array) -> Factors:
    """Factor a numerator in powers of z⁻¹, shape (k,), not all zero.

    >>> found = factors(np.array([0.0, 1.0, -2.5, 1.0]))
    >>> found.delay, found.inside.round(9).tolist(), found.outside.round(9).tolist()
    (1, [1.0, -0.5], [1.0, -2.0])
    """
    kept = np.flatnonzero(np.abs(numerator) > NEGLIGIBLE * np.abs(numerator).max())
    delay, b = int(kept[0]), numerator[kept[0] : kept[-1] + 1]
    zeros = np.roots(b)
    radius = np.abs(zeros)
    outside = np.atleast_1d(np.real(np.poly(zeros[radius >= NEAREST])))
    near = np.atleast_1d(np.real(np.poly(zeros[(radius > INSIDE) & (radius < NEAREST)])))
    inside = b[0] * np.atleast_1d(np.real(np.poly(zeros[radius <= INSIDE])))
    beyond = np.atleast_1d(np.convolve(outside, near))
    inside, beyond = _polished(b, inside, beyond) if near.size == 1 else (inside, beyond)
    return Factors(delay, inside, beyond if near.size == 1 else outside, near)


def _polished(b: Array, p: Array, q: Array) -> tuple[Array, Array]:
    """Improve the factors p and q of b by Newton steps, with q[0] = 1. Roots of long polynomials are not accurate."""
    for _ in range(3):
        missing = b - np.convolve(p, q)
        by_p = convolution_matrix(q, p.size)
        by_q = convolution_matrix(p, q.size)[:, 1:]
        step = np.linalg.lstsq(np.hstack((by_p, by_q)), missing, rcond=None)[0]
        p = p + step[: p.size]
        q = q + np.append(0.0, step[p.size :])
    return p, q


def preview_taps(outside: Array) -> tuple[int, Array]:
    """1/outside as a filter that uses future samples.

    Returns
    -------
    preview : int
        Number of future samples that it uses.
    taps : (k,) ndarray
        y_i = Σ_q taps_q x_(i + preview − q).
    """
    order = outside.size - 1
    if order == 0:
        return 0, 1.0 / outside
    taps = scipy.signal.lfilter([1.0], outside[::-1] / outside[-1], np.eye(1, LONGEST + order)[0]) / outside[-1]
    # summed from the tail, because the dropped taps together must stay below rounding
    left = np.cumsum(np.abs(taps[::-1]))[::-1]
    count = max(1, int((left > ROUNDING * left[0]).sum()))
    return order + count - 1, taps[:count][::-1].copy()


def zero_phase_taps(near: Array) -> tuple[int, Array]:
    """1/near, for zeros at the unit circle: zero-phase tracking (Tomizuka 1987) with `ORDER` terms of gain correction.

    1/near(z⁻¹) is near(z)/|near|², and 1/|near|² is expanded in a series about its value at dc.
    """
    order = near.size - 1
    if order == 0:
        return 0, np.ones(1)
    square = np.convolve(near, near[::-1]) / near.sum() ** 2
    largest = float(np.abs(np.fft.rfft(square, 4096)).max())
    terms = ORDER if largest < 2.0 else 0
    rest = -square
    rest[order] += 1.0
    series, power = np.ones(1), np.ones(1)
    for _ in range(terms):
        power = np.convolve(power, rest)
        series = np.pad(series, order) + power
    return order * (terms + 1), np.convolve(near[::-1], series) / near.sum() ** 2
