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

For independent scores x_i with the covariance Σ and the slopes M_i, a change θ of one group since score j gives the
statistic (Σ_i m_iᵀ Σ⁻¹ x_i)² / Σ_i m_iᵀ Σ⁻¹ m_i. The sums go from score j to the newest one, and m_i is the column of
M_i of that group (Basseville, Nikiforov: Detection of Abrupt Changes, 1993, Sec. 7.2). The denominator is increased for
correlated scores, for the finite length of the baseline, and for misfit of the model that drifts.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .baseline import Baseline, DriveClass, drive_class
from .false_alarm_threshold import WINDOW, false_alarm_threshold, of_estimated_variance
from .scatter import Scatter, beside_offset
from .score import GROUPS, ChangeScore

Array = NDArray[np.float64]

GROWTH = 6.0
"""Variance of a random walk after the time of the baseline, over that of its windows about their mean."""

ALIKE = 0.97
"""If the cosine between the directions of two groups is larger, the present drive cannot distinguish the groups."""

CANCELLED = 0.01
"""Of the groups that the drive cannot distinguish, one is not named if an offset would have to cancel so much of its
change that the share of its information that is left is smaller by this factor: under a sine of 20 Hz, the slow part
moves almost only the mean."""

OFFSET_SCORES = 50
"""Number of scores from which the offset of a new stream is estimated: the zero of the sensor may be another one."""

_OFFSET = GROUPS.index("offset")
"""Row of the offset."""


@dataclass(frozen=True, slots=True)
class Change:
    """Result of the change watch for one score.

    Parameters
    ----------
    statistic : float
        Largest statistic of all groups and onsets, divided by its threshold; above 1 the stage has changed.
    groups : tuple of str
        The group with the largest statistic, then the groups that the present drive cannot distinguish from it; empty
        if there is no statistic.
    estimate, deviation : float
        Change of the first group and its standard deviation, in the unit of this group in `UNITS`.
    onset : int
        Stamp of the most probable onset of the change [ns].
    watched : bool
        False if the baseline has no class for the present drive, or if this drive excites no group.
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
        Baseline of the running model.
    false_alarm_interval : float
        Wanted mean time between false alarms [s].
    same_offset : bool
        True if the sensor offset is the one with which the baseline was taken. Otherwise it is estimated from the first
        `OFFSET_SCORES` scores.
    """

    def __init__(self, baseline: Baseline, false_alarm_interval: float, *, same_offset: bool) -> None:
        self._baseline = baseline
        self._offset_scores_left = 0 if same_offset else OFFSET_SCORES
        self._same_offset = same_offset
        self._offset, self._offset_weight = 0.0, 0.0
        self._interval = false_alarm_interval
        self._thresholds: dict[DriveClass, float] = {}
        self._window: list[tuple[Array, Array, int, DriveClass]] = []
        self._age, self._counted = 0, sum(scatter.count for scatter in baseline.scatter.values())
        self._hidden_drift = {key: _hidden_drift(scatter) for key, scatter in baseline.scatter.items()}

    def add(self, score: ChangeScore) -> Change:
        """Compare the next score with the baseline, and return the result of the watch."""
        key = drive_class(score)
        scatter = self._baseline.scatter.get(key)
        if scatter is None or not scatter.excited.any():
            return Change()
        gradient, weight = scatter.gradient(score)
        if self._offset_scores_left:
            self._offset_scores_left -= 1
            self._offset += gradient[_OFFSET]
            self._offset_weight += weight[_OFFSET, _OFFSET]
            return Change(watched=True)
        if self._offset_weight:
            gradient = gradient - weight[:, _OFFSET] * (self._offset / self._offset_weight)
        self._age += 1
        self._window.append((gradient, weight, score.stamp - round(score.duration * 1e9), key))
        del self._window[:-WINDOW]
        sums = [np.cumsum([row[k] for row in reversed(self._window)], axis=0) for k in (0, 1)]
        gradients, weights = beside_offset(*sums)
        variance = self._variance(scatter, weights)
        seen = scatter.excited & (weights > 0.0)
        statistic = np.where(seen, gradients**2 / np.where(seen, weights * variance, 1.0), 0.0)
        at, largest = np.unravel_index(int(statistic.argmax()), statistic.shape)
        candidates, metric = seen[at] & (np.arange(len(GROUPS)) != _OFFSET), _left_by_offset(sums[1][at])
        if largest == _OFFSET or not candidates.any():  # a change of another group moves the offset, too
            gradients, weights, candidates = sums[0], np.diagonal(sums[1], axis1=1, axis2=2), seen[at]
            variance, metric = self._variance(scatter, weights, sums[1]), sums[1][at]
        gains = np.where(candidates, gradients[at] ** 2 / np.where(candidates, weights[at], 1.0), -1.0)
        alike = _alike(int(gains.argmax()), metric)
        left = np.diag(metric)[alike] / np.diag(sums[1][at])[alike]
        alike = [k for k, share in zip(alike, left, strict=True) if share > CANCELLED * left.max()]
        group = max(alike, key=lambda k: gains[k])
        return Change(
            float(statistic[at, largest]) / self._threshold(score.duration),
            tuple(GROUPS[k] for k in (group, *(k for k in alike if k != group))),
            float(gradients[at, group] / weights[at, group]),
            float(np.sqrt(variance[at, group] / weights[at, group])),
            self._window[-1 - int(at)][2],
            True,
        )

    def _variance(self, scatter: Scatter, weights: Array, beside: Array | None = None) -> Array:
        """Variance of the sums of the window over that of independent scores (n, 5).

        A window may hold several classes of drive, each with its own correlation, drift and mean. The error of a mean
        is common to all scores of its class. `beside` are the weights (n, 5, 5) where the offset drifts beside a group.
        """
        length = np.arange(1, len(weights) + 1)[:, None]
        classes = [row[3] for row in reversed(self._window)]
        inflation, wander, mean = np.zeros_like(weights), np.zeros_like(weights), np.zeros_like(weights)
        gained, there = np.diff(weights, axis=0, prepend=0.0), np.where(weights > 0.0, weights, 1.0)
        for key in set(classes):
            known = self._baseline.scatter[key]
            own = np.cumsum(np.where(np.array([k == key for k in classes])[:, None], gained, 0.0), axis=0)
            information = known.count * known.weight
            mean += own**2 / np.where(information > 0.0, information, np.inf) / there
            inflation += own / there * known.inflation(len(weights))
            wander += own / there * known.wander
        wander[:, _OFFSET] += self._drift_since(classes)
        variance = 1.0 + mean
        if not self._same_offset:
            variance = variance + _squared_cosine_to_offset(scatter) * length / OFFSET_SCORES
        return variance * inflation + (wander if beside is None else _drift(beside, wander)) * weights

    def _drift_since(self, classes: Sequence[DriveClass]) -> float:
        """Variance by which the offset may have drifted since the baseline [m²], as a random walk does.

        The baseline shows no drift that is smaller than the noise of its windows.
        """
        keys = set(classes)
        shown = max(self._baseline.scatter[key].wander[_OFFSET] for key in keys)
        walked = shown + max(self._hidden_drift[key] for key in keys)
        return float(GROWTH * self._age / self._counted * walked)

    def _threshold(self, duration: float) -> float:
        """The largest threshold of the classes of drive in the window."""
        classes = {row[3] for row in self._window}
        for key in classes - self._thresholds.keys():
            scatter = self._baseline.scatter[key]
            tested = _apart_from_offset(directions(scatter))
            exact = false_alarm_threshold(tested, self._interval / duration, scatter.memory)
            self._thresholds[key] = of_estimated_variance(exact, scatter.independent)
        return max(self._thresholds[key] for key in classes)


def _alike(group: int, metric: Array) -> list[int]:
    """A group, and those that a sum of scores with this Fisher information (5, 5) cannot distinguish from it."""
    size = np.sqrt(np.maximum(np.diag(metric), 0.0))
    cosine = np.abs(metric[group]) / np.where(size > 0.0, size, np.inf) / size[group]
    return [group, *(int(k) for k in np.argsort(-cosine) if k != group and cosine[k] > ALIKE)]


def _left_by_offset(information: Array) -> Array:
    """Fisher information (5, 5) about the other groups if the offset is not known."""
    along, known = information[_OFFSET], information[_OFFSET, _OFFSET]
    return information - np.outer(along, along) / known if known > 0.0 else information


def _apart_from_offset(direction: Array) -> Array:
    """The directions (5, 5) of the groups, those of the others without their part along that of the offset."""
    offset = direction[_OFFSET]
    along = direction @ offset / np.maximum(offset @ offset, np.finfo(np.float64).tiny)
    along[_OFFSET] = 0.0
    return np.asarray(direction - np.outer(along, offset))


def _hidden_drift(scatter: Scatter) -> float:
    """Variance of the mean offset of a window by noise [m²], below which a baseline shows no drift."""
    weight = scatter.weight[_OFFSET]
    return float(scatter.inflation(WINDOW)[-1, _OFFSET] / (WINDOW * weight)) if weight > 0.0 else 0.0


def _drift(weights: Array, wander: Array) -> Array:
    """Variance of the apparent change of each group (n, 5) by its own drift and by that of the offset (both n, 5)."""
    own = np.diagonal(weights, axis1=1, axis2=2)
    share = weights[:, :, _OFFSET] / np.where(own > 0.0, own, np.inf)
    share[:, _OFFSET] = 0.0
    return wander + share**2 * wander[:, _OFFSET, None]


def _squared_cosine_to_offset(scatter: Scatter) -> Array:
    """Squared cosine between the direction of every group and that of the offset, shape (5,)."""
    direction = directions(scatter)
    size = np.linalg.norm(direction, axis=1)
    cosine = direction @ direction[_OFFSET] / np.where(size > 0.0, size, 1.0) / size[_OFFSET]
    return cosine**2


def directions(scatter: Scatter) -> Array:
    """Direction in which a change of each group moves a whitened score, shape (5, 5), one row for each group."""
    _, weight = scatter.gradient(ChangeScore(np.zeros(len(GROUPS)), scatter.slope, 0.0, 0.0, 0, 0.0))
    size = np.sqrt(np.diag(weight))
    alike = weight / np.where(size > 0.0, size, 1.0)[:, None] / np.where(size > 0.0, size, 1.0)
    values, vectors = np.linalg.eigh(alike)
    return size[:, None] * (vectors * np.sqrt(np.maximum(values, 0.0)) @ vectors.T)
