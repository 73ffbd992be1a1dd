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

The largest of many windows is not χ²-distributed, and windows of correlated scores resemble one another more than
windows of independent ones. The stream of an unchanged stage is simulated instead.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...blocks.kernel import kernel

Array = NDArray[np.float64]

WINDOW = 120
"""Number of newest scores in which a change is searched for."""

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
    """Largest squared sum over its variance, of windows that end at each score, over all groups.

    series (n, g) has unit variance, inflation (longest, g) is the variance of a sum over its length; largest (n,) is
    written.
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
def correlate(series, decay, echo):  # type: ignore[no-untyped-def]
    """Make columns of a white series (n, g) autoregressive, x_i = decay x_(i − 1) + e_i + echo e_(i − 1), in place."""
    for g in range(series.shape[1]):
        size = np.sqrt((1.0 - decay[g] ** 2) / (1.0 + 2.0 * decay[g] * echo[g] + echo[g] ** 2))
        before = x = 0.0
        for i in range(series.shape[0]):
            white = size * series[i, g]
            x = decay[g] * x + white + echo[g] * before
            before = white
            series[i, g] = x


@kernel
def count_alarms(statistic, level, cleared):  # type: ignore[no-untyped-def]
    """Times at which the statistic (n,) rises above `level` after it was below `cleared`."""
    count, above = 0, False
    for value in statistic:
        if not above and value > level:
            count, above = count + 1, True
        elif value < cleared:
            above = False
    return count


def inflation(memory: Array, longest: int) -> Array:
    """Variance of the sum of 1, 2, … `longest` scores over that of as many independent ones, shape (longest, g).

    Parameters
    ----------
    memory : (2, g) ndarray
        As `Scatter.memory`.
    longest : int
        Length of the longest sum.
    """
    lag = np.arange(1, longest)[:, None]
    correlation = memory[0] * memory[1] ** (lag - 1)
    none = np.zeros((1, memory.shape[1]))
    total, first = (np.vstack((none, np.cumsum(c, axis=0))) for c in (correlation, lag * correlation))
    return 1.0 + 2.0 * (total - first / np.arange(1, longest + 1)[:, None])


def false_alarm_threshold(directions: Array, interval: float, memory: Array | None = None, seed: int = 0) -> float:
    """Value that the statistic exceeds once in `interval` scores on average, while nothing changes.

    Parameters
    ----------
    directions : (g, d) ndarray
        Direction in which the white score moves for a change of each group; normalised here.
    interval : float
        Wanted mean number of scores between false alarms.
    memory : (2, g) ndarray, optional
        As `Scatter.memory`; default: scores are independent of one another.
    seed : int
        Seed of the simulation.

    Returns
    -------
    float
        Beyond the rates that the simulation reaches, the rate is proportional to √h exp(−h/2) at a threshold h
        (Siegmund, Venkatraman, Ann. Statist. 23 (1995) 255).

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
    correlate(series, held[1], echo(held))
    largest = np.zeros(SIMULATED)
    largest_windows(series, inflation(held, WINDOW), largest)
    level, alarms = _highest_level(largest)
    wanted = np.log(SIMULATED / alarms / interval)
    levels = level + np.linspace(-20.0, 60.0, 8001)
    levels = levels[levels > 1.0]
    rates = 0.5 * np.log(levels / level) - 0.5 * (levels - level)
    return float(np.interp(-wanted, -rates, levels))


def echo(memory: Array) -> Array:
    """Share of the white number before, with which `correlate` gives a series this memory, shape (g,).

    Parameters
    ----------
    memory : (2, g) ndarray
        As `Scatter.memory`.
    """
    apart = memory[0] - memory[1]
    linear = 2.0 * memory[0] * memory[1] - 1.0 - memory[1] ** 2
    root = np.sqrt(np.maximum(linear**2 - 4.0 * apart**2, 0.0))
    return 2.0 * apart / (root - linear)


def _highest_level(statistic: Array) -> tuple[float, int]:
    """Highest level that enough alarms exceed, and their number."""
    level = float(statistic.max())
    while True:
        alarms = int(count_alarms(statistic, level, CLEARED * level))
        if alarms >= ALARMS or level < _LEVEL_STEP:
            return level, alarms
        level -= _LEVEL_STEP
