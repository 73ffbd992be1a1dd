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

"""The dominant mode of an ARX, and the dynamics between this mode and the sensor."""

from __future__ import annotations

import numpy as np

from ...errors import ModelError
from ..arx import ArxBlock
from ..block import Array


def split(a: Array, b: Array) -> tuple[Array, Array, Array]:
    """Dominant mode (m1, m2) of B/A, the rest of A without its leading 1, and their derivatives by a, (na, na).

    The dominant mode is the complex pole pair with the largest residue over distance from the unit circle.

    Raises
    ------
    ModelError
        If A has no complex pole pair, or if the dominant one is double.

    >>> mode, rest, _ = split(np.array([-1.7, 1.1, -0.16]), np.ones(1))
    >>> mode.round(9).tolist(), rest.round(9).tolist()
    ([-1.5, 0.8], [-0.2])
    """
    poles = np.roots(np.append(1.0, a))
    above = poles[poles.imag > 1e-9]
    if not above.size:
        raise ModelError("softening: the ARX has no complex pole pair; expected a resonance, order 2 or more")

    def height(pole: complex) -> float:
        others = poles[np.abs(poles - pole) > 0]
        return float(np.abs(np.polyval(b[::-1], 1 / pole) / np.prod(1 - others / pole)) / (1 - np.abs(pole)))

    pole = max(above, key=height)
    mode = np.array([-2.0 * pole.real, np.abs(pole) ** 2])
    rest = np.polydiv(np.append(1.0, a), np.append(1.0, mode))[0][1:]
    columns = np.zeros((a.size, a.size))
    for k in range(a.size):
        factor = np.append(1.0, rest if k < 2 else mode)
        first = k if k < 2 else k - 2
        columns[first : first + factor.size, k] = factor[: a.size - first]
    return mode, rest, _inverse(columns)


def share_of_mode(a: Array, b: Array, mode: Array, rest: Array, by_a: Array) -> tuple[Array, Array, Array]:
    """Numerator (n0, n1) of the mode with B/A written as a sum, and its derivatives by a (2, na) and b (2, nb).

    B = N R + S M, with the rest R of A, is one linear equation for N and S (Sylvester matrix).

    >>> mode, rest, by_a = split(np.array([-1.7, 1.1, -0.16]), np.ones(1))
    >>> share_of_mode(np.array([-1.7, 1.1, -0.16]), np.ones(1), mode, rest, by_a)[0].round(6).tolist()
    [0.925926, 0.296296]
    """
    size = max(b.size, a.size)
    resonance, others = np.append(1.0, mode), np.append(1.0, rest)
    sylvester = np.zeros((size, size))
    for k in range(size):
        column = others if k < 2 else resonance
        first = k if k < 2 else k - 2
        sylvester[first : first + column.size, k] = column
    inverse = _inverse(sylvester)
    parts = inverse @ np.pad(b, (0, size - b.size))
    numerator, remainder = parts[:2], parts[2:]
    moved = np.zeros((size, a.size))
    for k in range(a.size):
        factor, first = (remainder, k + 1) if k < 2 else (numerator, k - 1)
        moved[first : first + factor.size, k] = factor
    return numerator, np.asarray(-(inverse @ moved @ by_a)[:2]), inverse[:2, : b.size]


def _inverse(matrix: Array) -> Array:
    try:
        return np.asarray(np.linalg.inv(matrix))
    except np.linalg.LinAlgError:
        raise ModelError("softening: the dominant pole pair of the ARX is double; expected a single mode") from None


class Path:
    """The dominant mode of an ARX, and the dynamics between this mode and the sensor.

    Parameters
    ----------
    arx : ArxBlock
        G.
    delay : float
        Delay of G [samples].

    Attributes
    ----------
    mode, rest : (2,), (na - 2,) ndarray
        m1 and m2, and the rest of A.
    mode_by_a, rest_by_a : (2, na), (na - 2, na) ndarray
        Derivatives of `mode` and `rest`.
    gain : float
        g.
    filter : ArxBlock
        The path divided by g.
    share : float
        Static gain of mode and path.
    share_slopes : (p,) ndarray
        Derivatives of `share` by the parameters of the ARX.
    by_a, by_b : (k, na), (k, nb) ndarray
        Derivatives of the coefficients of the filter at constant g.
    """

    filter: ArxBlock
    share: float
    share_slopes: Array
    by_a: Array
    by_b: Array

    def __init__(self, arx: ArxBlock, delay: float) -> None:
        self.mode, self.rest, slopes = split(arx.a, arx.b)
        self.mode_by_a, self.rest_by_a = slopes[:2], slopes[2:]
        self.gain = 1.0 + float(self.mode.sum())


class WholePath(Path):
    """The mode drives all other dynamics of G."""

    def __init__(self, arx: ArxBlock, delay: float) -> None:
        super().__init__(arx, delay)
        na, nb = arx.a.size, arx.b.size
        self.filter = ArxBlock((), self.rest, arx.b / self.gain, delay)
        self.share, self.share_slopes = arx.gain, arx.gain_slopes()
        self.by_a = np.vstack((self.rest_by_a, np.zeros((nb, na))))
        self.by_b = np.vstack((np.zeros((na - 2, nb)), np.eye(nb) / self.gain))


class OwnPath(Path):
    """The share of the mode in a sum of modes."""

    def __init__(self, arx: ArxBlock, delay: float) -> None:
        super().__init__(arx, delay)
        slopes = np.vstack((self.mode_by_a, self.rest_by_a))
        taps, by_a, by_b = share_of_mode(arx.a, arx.b, self.mode, self.rest, slopes)
        self.filter = ArxBlock((), np.zeros(1), taps / self.gain, delay)
        self.share = float(taps.sum()) / self.gain
        free = np.zeros(len(arx.names))
        free[: arx.a.size] = (by_a.sum(axis=0) - self.share * self.mode_by_a.sum(axis=0)) / self.gain
        free[arx.a.size : arx.a.size + arx.b.size] = by_b.sum(axis=0) / self.gain
        self.share_slopes = free
        still = ((1, 0), (0, 0))  # the filter has no feedback
        self.by_a, self.by_b = np.pad(by_a / self.gain, still), np.pad(by_b / self.gain, still)
