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

"""`outlying_stages`: stages with a parameter that differs much from those of the other stages."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .history import FleetHistory, ParameterSeries

FAR = 3.5
"""Distance from which a stage is outlying, in standard deviations (Iglewicz and Hoaglin 1993, modified z-score)."""
FEWEST = 4
"""Smallest number of stages for an estimate of their spread."""
MAD = 1.4826
"""Ratio of the standard deviation of a normal distribution to its median absolute deviation."""


@dataclass(frozen=True, slots=True)
class OutlyingStage:
    """A stage that differs from the others.

    Parameters
    ----------
    stage, parameter, unit : str
        Name of the stage, name of the parameter and its unit.
    value : float
        Median over the recordings of the stage.
    typical : float
        Median over the stages.
    distance : float
        |value − typical| over the root of the sum of squares of the spread of the stages and of the standard error of
        one recording.
    """

    stage: str
    parameter: str
    unit: str
    value: float
    typical: float
    distance: float


def outlying_stages(history: FleetHistory) -> tuple[OutlyingStage, ...]:
    """The stages that differ from the others, the farthest first.

    Parameters
    ----------
    history : FleetHistory
    """
    found = [o for name, series in history.parameters.items() for o in _outlying(history, name, series)]
    return tuple(sorted(found, key=lambda o: -o.distance))


def _outlying(history: FleetHistory, name: str, series: ParameterSeries) -> list[OutlyingStage]:
    errors = series.standard_error
    known = np.isfinite(errors)  # a value at a bound, or an assumed one, is no estimate
    owner, value, errors = history.stage[series.index][known], series.value[known], errors[known]
    stages = np.unique(owner)
    if stages.size < FEWEST:
        return []
    medians, sure = (np.array([np.median(x[owner == stage]) for stage in stages]) for x in (value, errors))
    typical = float(np.median(medians))
    scale = np.hypot(MAD * np.median(np.abs(medians - typical)), sure)
    distance = np.divide(np.abs(medians - typical), scale, out=np.zeros_like(scale), where=scale > 0.0)
    return [
        OutlyingStage(str(s), name, series.unit, float(m), typical, float(d))
        for s, m, d in zip(stages, medians, distance, strict=True)
        if d > FAR
    ]
