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

"""`is_row_of_waves`: whether a drive consists of sines or triangles of a few rates, one after another."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...blocks.kernel import kernel
from ...record import Samples
from ...turning_points import find_turns as plain_find_turns

SWING = 0.005
"""A turning point counts if the drive goes back by this share of its range."""
ABOVE = 10.0
"""The same, in standard deviations of the noise that the drive was measured with."""
ALIKE = 0.05
"""Largest relative difference between the durations of two swings of one rate."""
FEWEST = 3
"""Smallest number of swings of one rate."""
MOST = 8
"""Largest number of rates; a chirp has more."""
COVERED = 0.7
"""Smallest share of the swings that belong to one of the rates."""
SHORTEST = 8
"""Smallest number of samples in a swing whose duration is known well enough."""
HARMONICS = 8.0
"""Largest ratio of bandwidth and rate of a sine or a triangle; a sequence of steps has a larger one."""
find_turns = kernel(plain_find_turns)
"""`turning_points.find_turns`, compiled."""


def is_row_of_waves(voltage: Samples, sample_period: float, bandwidth: float, noise: float = 0.0) -> bool:
    """True for sines or triangles of a few rates one after another, of any amplitudes.

    The frequencies of a short wave are spread, but they determine the response at its rate only.

    Parameters
    ----------
    voltage : (n,) ndarray
        Drive [V].
    sample_period : float
        Time between samples [s].
    bandwidth : float
        Bandwidth of the drive [Hz].
    noise : float
        Noise of the voltage [V]; smaller turns than `ABOVE` times it are no turns.

    Examples
    --------
    >>> t = 1e-3 * np.arange(2000)
    >>> waves = np.concatenate((np.sin(2 * np.pi * 2 * t), np.sin(2 * np.pi * 20 * t)))
    >>> is_row_of_waves(waves, 1e-3, 21.0), is_row_of_waves(np.sign(waves), 1e-3, 400.0)
    (True, False)
    """
    swings = _swings(voltage, noise)
    if swings.size < FEWEST:
        return False
    rates, covered, shortest, *_ = _rows(swings)
    slow_enough = 2.0 * shortest * sample_period * bandwidth <= HARMONICS
    return bool(0 < rates <= MOST and covered >= COVERED * swings.size and shortest >= SHORTEST and slow_enough)


def rates_of_waves(voltage: Samples, sample_period: float, noise: float = 0.0) -> tuple[float, float]:
    """Rates of the slowest and of the fastest wave of such a drive [Hz]; arguments as above."""
    *_, shortest, longest = _rows(_swings(voltage, noise))
    return 0.5 / (longest * sample_period), 0.5 / (shortest * sample_period)


def _swings(voltage: Samples, noise: float) -> NDArray[np.int64]:
    """Samples of every swing from one turning point to the next."""
    turns = np.empty(voltage.size, np.int64)
    count = find_turns(voltage, max(SWING * float(np.ptp(voltage)), ABOVE * noise), False, turns)
    return np.diff(turns[:count])


@kernel
def _rows(sizes: NDArray[np.int64]) -> tuple[int, int, int, float, float]:
    """Rows of at least `FEWEST` swings that take equally long.

    Returns their number, the number of swings in them, the samples of the shortest such swing, and the mean samples of
    a swing in the fastest and in the slowest row.
    """
    rates, covered, shortest, fast, slow = 0, 0, 1 << 60, np.inf, 0.0
    first = 0
    for i in range(1, sizes.size + 1):
        if i < sizes.size and abs(sizes[i] - sizes[first]) <= ALIKE * sizes[first] + 1.5:
            continue
        if i - first >= FEWEST:
            rates += 1
            covered += i - first
            shortest = min(shortest, sizes[first])
            mean = sizes[first:i].mean()
            fast, slow = min(fast, mean), max(slow, mean)
        first = i
    return rates, covered, shortest, fast, slow
