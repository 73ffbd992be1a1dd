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

"""`false_alarm_threshold`: the threshold of the statistic that gives the wanted rate of false alarms.

The maximum over many windows does not have a χ² distribution, and its distribution depends on the correlation of the
scores. Therefore the scores of an unchanged stage are simulated, and the threshold is read from the simulation.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr, stdtrit

from ...blocks.kernel import kernel

Array = NDArray[np.float64]

WINDOW = 120
"""Number of newest scores in which the onset of a change is searched."""

CLEARED = 0.5
"""An alarm ends where the statistic falls below this share of its threshold."""

SIMULATED = 400_000
"""Number of simulated scores."""

ALARMS = 300
"""Fewest false alarms in the simulation from which their rate is estimated."""

_LEVEL_STEP = 0.25
"""Distance between the levels at which false alarms are counted."""


@kernel
def largest_windows(series, inflation, largest):  # type: ignore[no-untyped-def]
    """For each score, the largest squared sum divided by its variance, over all groups and all windows that end there.

    `series` (n, g) has unit variance. `inflation` (longest, g) is the variance of a sum divided by the number of its
    scores. The result is written to `largest` (n,).
    """
    total = np.zeros(series.shape[1])
    for i in range(largest.size):
        total[:] = 0.0
        most = 0.0
        for k in range(min(inflation.shape[0], i + 1)):
            for g in range(total.size):
                total[g] += series[i - k, g]
                most = max(most, total[g] * total[g] / ((k + 1) * inflation[k, g]))
        largest[i] = most


@kernel
def correlate(series, decay, average):  # type: ignore[no-untyped-def]
    """Make each column of a white series (n, g) an ARMA(1, 1) series of unit variance, in place.

    x_i = decay x_(i − 1) + e_i + average e_(i − 1), where e is the white series times a constant.
    """
    for g in range(series.shape[1]):
        size = np.sqrt((1.0 - decay[g] ** 2) / (1.0 + 2.0 * decay[g] * average[g] + average[g] ** 2))
        before = x = 0.0
        for i in range(series.shape[0]):
            white = size * series[i, g]
            x = decay[g] * x + white + average[g] * before
            before = white
            series[i, g] = x


@kernel
def count_alarms(statistic, level, cleared):  # type: ignore[no-untyped-def]
    """Number of times that the statistic (n,) rises above `level`, counted again only after it was below `cleared`."""
    count, above = 0, False
    for value in statistic:
        if not above and value > level:
            count, above = count + 1, True
        elif value < cleared:
            above = False
    return count


def inflation(memory: Array, longest: int) -> Array:
    """Variance of the sum of 1, 2, … `longest` scores, divided by that of as many independent scores.

    Parameters
    ----------
    memory : (2, g) ndarray
        Correlation of the scores, as in `Scatter.memory`.
    longest : int
        Number of scores of the longest sum.

    Returns
    -------
    (longest, g) ndarray
    """
    lag = np.arange(1, longest)[:, None]
    correlation = memory[0] * memory[1] ** (lag - 1)
    none = np.zeros((1, memory.shape[1]))
    total, first = (np.vstack((none, np.cumsum(c, axis=0))) for c in (correlation, lag * correlation))
    return 1.0 + 2.0 * (total - first / np.arange(1, longest + 1)[:, None])


def false_alarm_threshold(directions: Array, interval: float, memory: Array | None = None, seed: int = 0) -> float:
    """Value that the statistic of an unchanged stage exceeds once in `interval` scores on average.

    Parameters
    ----------
    directions : (g, d) ndarray
        Direction in which a change of each group moves a whitened score; its length does not matter.
    interval : float
        Wanted mean number of scores between false alarms.
    memory : (2, g) ndarray, optional
        Correlation of the scores, as in `Scatter.memory`; default: independent scores.
    seed : int
        Seed of the simulation.

    Returns
    -------
    float
        The threshold; infinite if all directions are zero. False alarms rarer than those of the simulation are
        extrapolated: their rate at a threshold h is proportional to √h exp(−h/2) (Siegmund, Venkatraman, Ann. Statist.
        23 (1995) 255).

    Examples
    --------
    >>> a, b = (false_alarm_threshold(np.eye(3), interval) for interval in (1e4, 1e6))
    >>> 15 < a < b < 45
    True
    """
    norm = np.linalg.norm(directions, axis=1)
    there = norm > 0.0
    if not there.any():
        return np.inf
    held = np.zeros((2, int(there.sum()))) if memory is None else memory[:, there]
    white = np.random.default_rng(seed).standard_normal((SIMULATED, directions.shape[1]))
    series = white @ (directions[there] / norm[there, None]).T
    correlate(series, held[1], moving_average(held))
    largest = np.zeros(SIMULATED)
    largest_windows(series, inflation(held, WINDOW), largest)
    level, alarms = _highest_level(largest)
    wanted = np.log(SIMULATED / alarms / interval)
    levels = level + np.linspace(-20.0, 60.0, 8001)
    levels = levels[levels > 1.0]
    rates = 0.5 * np.log(levels / level) - 0.5 * (levels - level)
    return float(np.interp(-wanted, -rates, levels))


def of_estimated_variance(threshold: float, independent: float) -> float:
    """Threshold of a squared normal variable whose variance was estimated: Student's t has wider tails.

    Parameters
    ----------
    threshold : float
        Threshold if the variance is known.
    independent : float
        Number of independent values from which the variance was estimated.

    Examples
    --------
    >>> [round(of_estimated_variance(25.0, count)) for count in (20.0, 100.0, 1e6)]
    [54, 29, 25]
    """
    freedom = max(1.0, independent - 1.0)
    return float(stdtrit(freedom, ndtr(-np.sqrt(threshold))) ** 2)


def moving_average(memory: Array) -> Array:
    """Moving-average coefficient with which `correlate` makes a series of a given correlation.

    Parameters
    ----------
    memory : (2, g) ndarray
        Correlation of the series, as in `Scatter.memory`.

    Returns
    -------
    (g,) ndarray
        Coefficient of each column, −1 to 1.
    """
    apart = memory[0] - memory[1]
    linear = 2.0 * memory[0] * memory[1] - 1.0 - memory[1] ** 2
    root = np.sqrt(np.maximum(linear**2 - 4.0 * apart**2, 0.0))
    return 2.0 * apart / (root - linear)


def _highest_level(statistic: Array) -> tuple[float, int]:
    """Highest level with at least `ALARMS` false alarms in the simulation, and their number."""
    level = float(statistic.max())
    while True:
        alarms = int(count_alarms(statistic, level, CLEARED * level))
        if alarms >= ALARMS or level < _LEVEL_STEP:
            return level, alarms
        level -= _LEVEL_STEP
