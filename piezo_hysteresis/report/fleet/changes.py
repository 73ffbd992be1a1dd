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

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from .history import FleetHistory, ParameterSeries
from .outliers import FAR


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
        |later − earlier| over the standard error of the difference of two recordings.
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
    errors = series.standard_error
    for stage in np.unique(owner):
        member = np.flatnonzero((owner == stage) & ~np.isnat(time) & np.isfinite(errors))
        if member.size < 2:
            continue
        before, after = member[: member.size // 2], member[-(member.size // 2) :]
        earlier, later = (float(np.median(series.value[half])) for half in (before, after))
        error = float(np.hypot(np.median(errors[before]), np.median(errors[after])))
        distance = abs(later - earlier) / error if error > 0.0 else 0.0
        if distance > FAR:
            yield ChangedStage(str(stage), name, series.unit, earlier, later, distance)
