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

The largest of many windows is not χ²-distributed. The stream of an unchanged stage is simulated instead.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...blocks.kernel import kernel

Array = NDArray[np.float64]

WINDOW = 60
"""Number of newest scores in which a change is searched for."""

SIMULATED = 200_000
"""Number of simulated scores."""

FEWEST_ALARMS = 40
"""Fewest false alarms in the simulation from which their rate is estimated."""


@kernel
def largest_windows(total, longest, largest):  # type: ignore[no-untyped-def]
    """Largest squared sum over window length, of windows of up to `longest` that end at each score, over all groups.

    total (n + 1, g) holds the sums up to each score; largest (n,) is written.
    """
    for i in range(largest.size):
        most = 0.0
        for k in range(1, min(longest, i + 1) + 1):
            for g in range(total.shape[1]):
                moved = total[i + 1, g] - total[i + 1 - k, g]
                most = max(most, moved * moved / k)
        largest[i] = most


def false_alarm_threshold(directions: Array, interval: float, seed: int = 0) -> float:
    """Value that the statistic exceeds once in `interval` scores on average, while nothing changes.

    Parameters
    ----------
    directions : (g, d) ndarray
        Direction in which the white score moves for a change of each group; normalised here.
    interval : float
        Wanted mean number of scores between false alarms.
    seed : int
        Seed of the simulation.

    Returns
    -------
    float
        Beyond the rates that the simulation reaches, log(rate) is continued as a straight line.

    Examples
    --------
    >>> a, b = (false_alarm_threshold(np.eye(3), interval) for interval in (1e4, 1e6))
    >>> 15 < a < b < 45
    True
    """
    norm = np.linalg.norm(directions, axis=1, keepdims=True)
    unit = directions[norm[:, 0] > 0.0] / norm[norm[:, 0] > 0.0]
    if unit.size == 0:
        return np.inf
    white = np.random.default_rng(seed).standard_normal((SIMULATED, unit.shape[1]))
    total = np.vstack((np.zeros(len(unit)), np.cumsum(white @ unit.T, axis=0)))
    largest = np.zeros(SIMULATED)
    largest_windows(np.ascontiguousarray(total), WINDOW, largest)
    levels = np.arange(4.0, largest.max(), 0.5)
    alarms = np.array([_alarms(largest > level) for level in levels])
    known = (alarms >= FEWEST_ALARMS) & (levels >= levels[alarms.argmax()])
    line = np.polyfit(levels[known], np.log(alarms[known] / SIMULATED), 1)
    return float((-np.log(interval) - line[1]) / line[0])


def _alarms(above: NDArray[np.bool_]) -> int:
    """Number of alarms. An alarm ends when the statistic has stayed below the threshold for a whole window."""
    places = np.flatnonzero(above)
    return int(places.size > 0) + int(np.count_nonzero(np.diff(places) > WINDOW))
