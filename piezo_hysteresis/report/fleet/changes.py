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

"""`changed_stages`: stages with a parameter that has changed from the earlier to the later recordings."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2, norm, t

from .history import FleetHistory, ParameterSeries
from .outliers import FAR

Array = NDArray[np.float64]

EFFICIENCY = 0.4
"""Degrees of freedom of the median of variances, as a share of those of their mean."""
ENOUGH = 4.0
"""Fewest degrees of freedom with which the recordings of a fleet show how much those of one stage differ."""


@dataclass(frozen=True, slots=True)
class ChangedStage:
    """A stage with a parameter that has changed.

    Parameters
    ----------
    stage, parameter, unit : str
        Name of the stage, name of the parameter and its unit.
    earlier, later : float
        Medians over the earlier and over the later half of the recordings of the stage.
    distance : float
        |later − earlier| over the standard error of the difference of two recordings, which contains how much
        recordings of one stage differ in this fleet; as deviations of a normal variable if few recordings show this.
    """

    stage: str
    parameter: str
    unit: str
    earlier: float
    later: float
    distance: float


def changed_stages(history: FleetHistory) -> tuple[ChangedStage, ...]:
    """The stages that have changed by more than `FAR` standard errors, the largest change first.

    Parameters
    ----------
    history : FleetHistory
    """
    found = [c for name, series in history.parameters.items() for c in _changed(history, name, series)]
    return tuple(sorted(found, key=lambda c: -c.distance))


def _changed(history: FleetHistory, name: str, series: ParameterSeries) -> Iterator[ChangedStage]:
    time, owner = history.time[series.index], history.stage[series.index]
    errors, value = series.standard_error, series.value
    known = ~np.isnat(time) & np.isfinite(errors)
    members = {str(stage): np.flatnonzero((owner == stage) & known) for stage in np.unique(owner)}
    halves = {s: (m[: m.size // 2], m[-(m.size // 2) :]) for s, m in members.items() if m.size > 1}
    scatter, freedom = _scatter([value[half] for both in halves.values() for half in both])
    typical = float(np.median(errors[known])) if halves else 0.0
    for stage, both in halves.items():
        earlier, later = (float(np.median(value[half])) for half in both)
        sizes = np.array([np.median(errors[half]) for half in both])
        if freedom >= ENOUGH and scatter > 0.0:  # an interval holds the error of form, which all recordings share
            wider = np.maximum(1.0, sizes / typical) if typical > 0.0 else np.ones(2)
            distance = _normal(abs(later - earlier) / (scatter * float(np.linalg.norm(wider))), freedom)
        else:
            error = float(np.linalg.norm([*sizes, scatter, scatter]))
            distance = abs(later - earlier) / error if error > 0.0 else 0.0
        if distance > FAR:
            yield ChangedStage(stage, name, series.unit, earlier, later, distance)


def _scatter(halves: Sequence[Array]) -> tuple[float, float]:
    """Standard deviation between the recordings of one half, of the median half, and its degrees of freedom."""
    squares = [np.var(h, ddof=1) * (h.size - 1) / chi2.median(h.size - 1) for h in halves if h.size > 1]
    freedom = EFFICIENCY * sum(h.size - 1 for h in halves)
    return (float(np.sqrt(np.median(squares))) if squares else 0.0), freedom


def _normal(distance: float, freedom: float) -> float:
    """The number of standard deviations of a normal variable that is as rare as a value of Student's t."""
    return min(distance, float(norm.isf(t.sf(distance, freedom))))  # the probability may be too small for a number
