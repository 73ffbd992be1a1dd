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

"""`fit_groups`: fits the parameters of the changed groups to the last minute of a stream.

The scores of the change watch are normal equations of the residual in the parameters of every group, with the scatter
of an unchanged stage as weights. They are summed from the most probable onset of the change. Then the model is changed
and simulates the minute again, until the parameters converge.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..errors import IdentificationError, PiezoError
from ..identification.stage_check import EXCESS, is_as_good
from ..model.model import Model
from ..online.change.baseline import Baseline, drive_class
from ..online.change.detector import directions
from ..online.change.false_alarm_threshold import WINDOW, false_alarm_threshold
from ..online.change.scatter import Scatter, residual_power
from ..online.change.score import BLOCK_TIME, GROUPS, ChangeScore
from .minute import Minute
from .moved_group import FULL, changed_by

Array = NDArray[np.float64]

FEWEST_SCORES = 20
"""Smallest number of scores after the onset for a fit."""
TURNS = 6
"""Largest number of linearisations."""
SETTLED = 0.1
"""Largest last step of a converged fit, in standard deviations."""
TRANSIENT = 0.1
"""Share of the time since a change that is not fitted, because the loop takes its new shape in it."""
APART = 0.05
"""Share of a group's weight that must remain after projection on the fitted groups, so that it can be distinguished."""
SURE = 1.96
"""Half a 95 % interval, in standard deviations."""

_OFFSET = GROUPS.index("offset")
"""Row of the offset."""


@dataclass(frozen=True, eq=False, slots=True)
class GroupFit:
    """A model with newly fitted parameters.

    Parameters
    ----------
    model : Model
        The new model.
    offset : float
        Sensor minus new model [m].
    groups : tuple of str
        Groups that were fitted in addition to the offset.
    change, deviation : (5,) ndarray
        Change of every group and its standard deviation, in the order and units of the watch; 0 where not fitted.
    before, after, floor : float
        RMS residual about its mean: with the old model, with the new one, and in the baseline [m].
    duration : float
        Duration of the fitted samples [s].
    """

    model: Model
    offset: float
    groups: tuple[str, ...]
    change: Array
    deviation: Array
    before: float
    after: float
    floor: float
    duration: float


def fit_groups(model: Model, minute: Minute, baseline: Baseline, group: str, interval: float) -> GroupFit:
    """Fit the parameters of a group, and of a second group if it still differs afterwards.

    Parameters
    ----------
    model : Model
        The running model.
    minute : Minute
        Drive and measurement.
    baseline : Baseline
        Baseline of the running model.
    group : str
        The changed group, from `group_to_fit`.
    interval : float
        Wanted mean time between false alarms of the watch [s].

    Returns
    -------
    GroupFit
        A fit whose RMS residual is at most `EXCESS` times that of the baseline.

    Raises
    ------
    IdentificationError
        If these parameters do not explain the change; the message proposes what to do.
    """
    fit = _Fit(model, minute, baseline, group, interval)
    groups: tuple[str, ...] = (group,)
    try:
        found = fit.of(groups)
        if found.remaining in ("gain", "loop", "dynamics", "offset") and found.remaining not in groups:
            groups = (group, found.remaining)
            found = fit.of(groups)
    except IdentificationError:
        raise
    except PiezoError as error:
        raise IdentificationError(f"the model cannot follow the change ({error}); {FULL}") from None
    return fit.checked(groups, found)


@dataclass(frozen=True, eq=False, slots=True)
class _Fitted:
    model: Model
    change: Array
    deviation: Array
    scores: list[ChangeScore]
    remaining: str


class _Fit:
    """Scores of the minute with any model, and their least-squares solution."""

    def __init__(self, model: Model, minute: Minute, baseline: Baseline, group: str, interval: float) -> None:
        self._model, self._minute, self._baseline = model, minute, baseline
        self._begun = 0
        every = self._scores(model, minute.offset)
        onset = self._onset(every, group)
        self._begun = onset + round(TRANSIENT * (len(every) - onset)) if onset else 0
        self._before = every[self._begun :]
        each = every[0].duration if every else BLOCK_TIME
        if len(self._before) < FEWEST_SCORES:
            raise IdentificationError(
                f"got {each * len(self._before):.1f} s since the change under the kinds of drive of the "
                f"baseline, expected at least {each * FEWEST_SCORES:g} s; try again later"
            )
        self._duration = each * len(self._before)
        classes = [drive_class(score) for score in self._before]
        self._main = baseline.scatter[max(set(classes), key=classes.count)]
        self._threshold = false_alarm_threshold(directions(self._main), interval / each)
        count = len(self._before)
        self._known = self._main.inflation(count)[-1] * (
            1.0 + count / min(self._scatter(s).count for s in self._before)
        )

    def of(self, groups: Sequence[str]) -> _Fitted:
        """The model with the fitted parameters of some groups."""
        free = sorted({GROUPS.index(g) for g in groups} | {_OFFSET})
        hidden = [GROUPS[k] for k in free if not self._main.excited[k]]
        if hidden:
            raise IdentificationError(f"the present drive does not excite {' and '.join(hidden)}; {FULL}")
        change, model, scores = np.zeros(len(GROUPS)), self._model, self._before
        deviation = np.zeros(len(GROUPS))
        for _ in range(TURNS):
            gram, gradient = self._equations(scores)
            inverse = np.linalg.pinv(_scaled(gram, free), hermitian=True)
            size = np.sqrt(np.diag(gram)[free])
            step = inverse @ (gradient[free] / size) / size
            variance = np.diag(inverse) * self._known[free] / size**2
            deviation[free] = np.sqrt(variance + self._main.wander[free])
            change[free] += step
            model = changed_by(self._model, change)
            scores = self._scores(model, self._minute.offset + change[_OFFSET])
            if (np.abs(step) < SETTLED * deviation[free]).all():
                break
        return _Fitted(model, change, deviation, scores, self._remaining(scores, free))

    def checked(self, groups: tuple[str, ...], found: _Fitted) -> GroupFit:
        """The fit, if its residual is nearly that of the baseline and its parameters have changed significantly."""
        before, after = (float(np.sqrt(residual_power(s))) for s in (self._before, found.scores))
        floor = float(np.sqrt(np.mean([self._scatter(s).power for s in self._before])))
        names = " and ".join(groups)
        if found.remaining or not is_as_good(after, floor):
            left = f", and {found.remaining} still differs" if found.remaining else ""
            raise IdentificationError(
                f"after a fit of {names} the residual is {1e9 * after:.3g} nm, expected at most {EXCESS:g} times the "
                f"{1e9 * floor:.3g} nm of the baseline{left}; {FULL}"
            )
        moved = [GROUPS.index(g) for g in groups]
        if (np.abs(found.change[moved]) < SURE * found.deviation[moved]).all():
            raise IdentificationError(
                f"the change of {names} is smaller than its uncertainty in {self._duration:.0f} s; try again later"
            )
        offset = self._minute.offset + float(found.change[_OFFSET])
        moved_by = found.change, found.deviation
        return GroupFit(found.model, offset, groups, *moved_by, before, after, floor, self._duration)

    def _scatter(self, score: ChangeScore) -> Scatter:
        return self._baseline.scatter[drive_class(score)]

    def _equations(self, scores: Sequence[ChangeScore]) -> tuple[Array, Array]:
        gram, gradient = np.zeros((len(GROUPS), len(GROUPS))), np.zeros(len(GROUPS))
        for score in scores:
            own, weight = self._scatter(score).gradient(score)
            gram += weight
            gradient += own
        return gram, gradient

    def _remaining(self, scores: Sequence[ChangeScore], fitted: Sequence[int]) -> str:
        """The group that the watch would report after the fit; empty for none."""
        gram, gradient = self._equations(scores)
        worst, name = 1.0, ""
        inner = np.linalg.pinv(gram[np.ix_(fitted, fitted)], hermitian=True)
        for k, group in enumerate(GROUPS):
            if k in fitted or not self._main.excited[k]:
                continue
            beside = gram[fitted, k]
            weight = gram[k, k] - beside @ inner @ beside
            if weight < APART * gram[k, k]:
                continue
            own = gradient[k] - beside @ inner @ gradient[fitted]
            window = min(1.0, WINDOW / len(scores))
            known = self._known[k] + window * weight * self._main.wander[k]
            statistic = window * own**2 / weight / known / self._threshold
            if statistic > worst:
                worst, name = statistic, group
        return name

    def _scores(self, model: Model, offset: float) -> list[ChangeScore]:
        """Scores since the change, for the classes of drive that the baseline contains."""
        every = self._minute.scores(model, offset)
        return [s for s in every if drive_class(s) in self._baseline.scatter][self._begun :]

    def _onset(self, scores: Sequence[ChangeScore], group: str) -> int:
        """Index of the score at which a step of a group, and of the offset, most probably began."""
        free = sorted({GROUPS.index(group), _OFFSET})
        gram, gradient = np.zeros((len(GROUPS), len(GROUPS))), np.zeros(len(GROUPS))
        best, begun = -np.inf, len(scores)
        for k in reversed(range(len(scores))):
            own, weight = self._scatter(scores[k]).gradient(scores[k])
            gram, gradient = gram + weight, gradient + own
            size = np.sqrt(np.maximum(np.diag(gram)[free], np.finfo(np.float64).tiny))
            scaled = gradient[free] / size
            gain = float(scaled @ np.linalg.pinv(_scaled(gram, free), hermitian=True) @ scaled)
            if gain > best:
                best, begun = gain, k
        return begun


def _scaled(gram: Array, free: Sequence[int]) -> Array:
    size = np.sqrt(np.maximum(np.diag(gram)[free], np.finfo(np.float64).tiny))
    return gram[np.ix_(free, free)] / size[:, None] / size
