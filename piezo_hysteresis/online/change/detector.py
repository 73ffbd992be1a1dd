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

"""`ChangeDetector`: windowed generalised likelihood ratio over the groups of parameters.

For scores x_i of known scatter Σ and slopes M_i, a change θ of one group since score j gives the statistic
(Σ_i m_iᵀ Σ⁻¹ x_i)² / Σ_i m_iᵀ Σ⁻¹ m_i, summed from j to now, with m_i the column of M_i of that group
(Basseville, Nikiforov: Detection of Abrupt Changes, 1993, Sec. 7.2).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .baseline import Baseline, DriveClass, drive_class
from .false_alarm_threshold import WINDOW, false_alarm_threshold
from .scatter import Scatter
from .score import BLOCK_TIME, GROUPS, ChangeScore

Array = NDArray[np.float64]

ALIKE = 0.97
"""Cosine of two groups' directions from which the present drive cannot distinguish them."""


RECENTRED = 50
"""Scores over which the offset of a new stream is estimated, because each stream has its own zero of the sensor."""

_OFFSET = GROUPS.index("offset")
"""Row of the offset."""


@dataclass(frozen=True, slots=True)
class Change:
    """Result of the change watch after a score.

    Parameters
    ----------
    statistic : float
        Largest statistic over its threshold; above 1 the stage has changed.
    groups : tuple of str
        Group that explains it best, and those that the present drive cannot distinguish from it; empty where nothing
        can be said.
    estimate, deviation : float
        Change of the first group and its standard deviation, in the unit of `UNITS`.
    onset : int
        Stamp at which the change began [ns].
    watched : bool
        False where the baseline has no class for the present drive, or where this drive excites no group.
    """

    statistic: float = 0.0
    groups: tuple[str, ...] = ()
    estimate: float = 0.0
    deviation: float = 0.0
    onset: int = 0
    watched: bool = False


class ChangeDetector:
    """Compares scores with a baseline.

    Parameters
    ----------
    baseline : Baseline
        Of the running model.
    false_alarm_interval : float
        Wanted mean time between false alarms [s].
    same_offset : bool
        True where the sensor offset is still the one that the baseline was taken with.
    """

    def __init__(self, baseline: Baseline, false_alarm_interval: float, *, same_offset: bool) -> None:
        self._baseline = baseline
        self._unlearnt = 0 if same_offset else RECENTRED
        self._same_offset = same_offset
        self._offset, self._offset_weight = 0.0, 0.0
        self._interval = false_alarm_interval / BLOCK_TIME
        self._thresholds: dict[DriveClass, float] = {}
        self._window: list[tuple[Array, Array, int, DriveClass]] = []

    def add(self, score: ChangeScore) -> Change:
        """Take the next score and return the result of the watch."""
        key = drive_class(score)
        scatter = self._baseline.scatter.get(key)
        if scatter is None or not scatter.excited.any():
            return Change()
        gradient, weight = scatter.gradient(score)
        if self._unlearnt:
            self._unlearnt -= 1
            self._offset += gradient[_OFFSET]
            self._offset_weight += weight[_OFFSET, _OFFSET]
            return Change(watched=True)
        if self._offset_weight:
            gradient = gradient - weight[:, _OFFSET] * (self._offset / self._offset_weight)
        self._window.append((gradient, np.diag(weight), score.stamp, key))
        del self._window[:-WINDOW]
        pulls, weights = (np.cumsum([row[k] for row in reversed(self._window)], axis=0) for k in (0, 1))
        length = np.arange(1, len(pulls) + 1)[:, None]
        certain = 1.0 + self._of_baseline(weights)
        if not self._same_offset:
            certain = certain + _like_offset(scatter) * length / RECENTRED
        known = certain * scatter.inflation(len(pulls)) + scatter.wander * weights
        seen = scatter.excited & (weights > 0.0)
        statistic = np.where(seen, pulls**2 / np.where(seen, weights, 1.0) / known, 0.0)
        at, group = np.unravel_index(int(statistic.argmax()), statistic.shape)
        return Change(
            float(statistic[at, group]) / self._threshold(key, scatter),
            self._alike(int(group), scatter),
            float(pulls[at, group] / weights[at, group]),
            float(np.sqrt(known[at, group] / weights[at, group])),
            self._window[-1 - int(at)][2] - round(BLOCK_TIME * 1e9),
            True,
        )

    def _of_baseline(self, weights: Array) -> Array:
        """Variance that the uncertain mean of the baseline adds to each sum of the window, over that of the sum itself.

        The scores of one class share the mean of their class, those of several classes do not.
        """
        added = np.zeros_like(weights)
        classes = [row[3] for row in reversed(self._window)]
        for key in set(classes):
            scatter = self._baseline.scatter[key]
            inside = np.array([k == key for k in classes])[:, None]
            own = np.cumsum(np.where(inside, np.diff(weights, axis=0, prepend=0.0), 0.0), axis=0)
            known = scatter.count * scatter.weight
            added += own**2 / np.where(known > 0.0, known, np.inf)
        return added / np.where(weights > 0.0, weights, 1.0)

    def _threshold(self, key: DriveClass, scatter: Scatter) -> float:
        if key not in self._thresholds:
            self._thresholds[key] = false_alarm_threshold(directions(scatter), self._interval, scatter.memory)
        return self._thresholds[key]

    def _alike(self, group: int, scatter: Scatter) -> tuple[str, ...]:
        direction = directions(scatter)
        size = np.linalg.norm(direction, axis=1)
        cosine = np.abs(direction @ direction[group]) / np.where(size > 0, size, np.inf) / size[group]
        others = [k for k in np.argsort(-cosine) if k != group and cosine[k] > ALIKE]
        return (GROUPS[group], *(GROUPS[k] for k in others))


def _like_offset(scatter: Scatter) -> Array:
    """Squared cosine between the direction of every group and that of the offset, shape (5,)."""
    direction = directions(scatter)
    size = np.linalg.norm(direction, axis=1)
    cosine = direction @ direction[_OFFSET] / np.where(size > 0.0, size, 1.0) / size[_OFFSET]
    return cosine**2


def directions(scatter: Scatter) -> Array:
    """Direction in which a whitened score moves for a change of each group, shape (5, 5)."""
    _, weight = scatter.gradient(ChangeScore(np.zeros(len(GROUPS)), scatter.slope, 0.0, 0.0, 0, 0.0))
    size = np.sqrt(np.diag(weight))
    alike = weight / np.where(size > 0.0, size, 1.0)[:, None] / np.where(size > 0.0, size, 1.0)
    values, vectors = np.linalg.eigh(alike)
    return size[:, None] * (vectors * np.sqrt(np.maximum(values, 0.0)) @ vectors.T)
