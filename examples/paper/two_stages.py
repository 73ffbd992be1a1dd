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

"""The paper's experiment on two simulated stages, identified in its three steps and jointly.

One stage has exact Bouc-Wen hysteresis, the other a Prandtl-Ishlinskii operator, which Bouc-Wen can only approach, as
on a real piezo. Neither shares code with the model.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import published
from numpy.typing import NDArray

from piezo_hysteresis import Experiment, Model, Record
from piezo_hysteresis.identification import (
    DriveLimits,
    Identification,
    Protocol,
    ThreeSteps,
    identify,
    paper,
    three_steps,
)
from piezo_hysteresis.identification.protocol.excitation import triangle
from piezo_hysteresis.stage.plant import PlantParameters
from piezo_hysteresis.stage.simulated import SimulatedStage

OPERATORS = ("bouc_wen", "prandtl_ishlinskii")
VALIDATION = (*(f"sine_{f:g}hz" for f in published.FREQUENCIES), "triangle_100hz", "validation")
"""Phases that are not fitted."""
TITLES = {"bouc_wen": "Bouc-Wen stage", "prandtl_ishlinskii": "Prandtl-Ishlinskii stage"}


SCALES = {"voltage_scale": published.MODEL.voltage_scale, "displacement_scale": published.MODEL.displacement_scale}


@cache
def plant(operator: str) -> PlantParameters:
    """The truth: a stage with nothing hidden, its hysteresis one of `OPERATORS`."""
    return PlantParameters.from_mapping({"hysteresis.operator": operator})


@cache
def experiment(operator: str) -> Experiment:
    """The protocol of the paper played on that stage, and the 100 Hz triangle of Fig. 9."""
    stage, protocol = SimulatedStage(plant(operator), seed=1), paper()
    records = [stage.play(p.voltage, p.name, average=p.stored_every) for p in protocol]
    records.append(stage.play(fast_triangle(protocol), "triangle_100hz"))
    return Experiment(tuple(records), source=TITLES[operator])


@cache
def published_steps(operator: str) -> ThreeSteps:
    """Delay, ARX and MBW, each identified by its own step, as in the paper."""
    return three_steps([r for r in experiment(operator) if r.phase not in VALIDATION], **SCALES)


@cache
def joint(operator: str) -> Identification:
    """All parameters refined together, on the same step, noise and triangle; everything else is held out."""
    gain = published.MODEL["arx"].dc_gain
    return identify(experiment(operator), gain=gain, held_out=VALIDATION, **SCALES)


def fast_triangle(protocol: Protocol) -> NDArray:
    """Ten periods of a 100 Hz triangle between 1 and 6 V, from the safe voltage to the safe voltage (Fig. 9)."""
    limits = protocol.limits
    return limits.from_safe_to_safe(triangle(limits, [0.6] * 10, 100.0, base=0.1))


def alone(model: Model) -> Model:
    """MBW alone: the dc gain of G in place of G."""
    static = model.without("arx")
    return replace(static, displacement_scale=model.displacement_scale * model["arx"].dc_gain)


def last_period(record: Record, frequency: float, level: float = 3.5) -> slice:
    """The last whole period before the way back from `level` [V] to the safe voltage."""
    limits = DriveLimits()
    back = (level - limits.safe_voltage) / limits.ramp_rate + limits.rest
    end = record.size - round(back / record.sample_period)
    return slice(end - round(1.0 / (frequency * record.sample_period)), end)
