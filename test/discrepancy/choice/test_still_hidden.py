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

"""Which slow effects phases to come may show, although the records so far show nothing."""

from __future__ import annotations

import numpy as np
import pytest

from piezo_hysteresis.discrepancy.choice.still_hidden import still_hidden
from piezo_hysteresis.discrepancy.choice.tiers import tiers
from piezo_hysteresis.effects import Arx, BoucWen, Creep, Offset, ThermalDrift
from piezo_hysteresis.effects.extent import Extent
from piezo_hysteresis.identification.protocol.drive_limits import DriveLimits
from piezo_hysteresis.identification.training.training_data import TrainingData
from piezo_hysteresis.model.model import Model
from piezo_hysteresis.record import Record

LIMITS = DriveLimits(1e-3)
PLAN = tiers(LIMITS)
STAGE = Model((BoucWen(A=0.4, beta=3.0, gamma=-0.5, p1=0.0, p2=1.0), Arx(b=(1.0,)), Offset()), 1e-3, 10.0, 1e-5)
FLOOR = 3e-9
"""0.03 % of the range [m]."""


def played(count: int, stage: Model = STAGE) -> TrainingData:
    """The first tiers, recorded without noise."""
    records, clock = list[Record](), 0.0
    for phase in (p for tier in PLAN[:count] for p in tier.phases):
        bare = Record(phase.voltage, np.zeros(phase.voltage.size), 1e-3, phase.name, start_time=clock)
        records.append(Record(phase.voltage, stage.simulate(bare)[0], 1e-3, phase.name, start_time=clock))
        clock += phase.duration
    return TrainingData(
        tuple(records),
        np.full(len(records), FLOOR),
        Extent.of(records, STAGE.voltage_scale, STAGE.displacement_scale),
    )


def hidden_after(count: int, *effects: type, stage: Model = STAGE) -> set[str]:
    data = played(count, stage)
    left = [p for tier in PLAN[count:] for p in tier.phases]
    clock = data.records[-1].start_time + data.records[-1].duration
    return still_hidden(STAGE, data, effects, left, clock, 0.005)


def test_long_holds_exclude_creep_and_drift() -> None:
    assert hidden_after(3, Creep, ThermalDrift) == set()


def test_fast_phases_exclude_no_drift_of_a_minute() -> None:
    assert hidden_after(1, ThermalDrift) == {"thermal_drift"}


@pytest.mark.parametrize("gamma", [2e-3, -2e-3])
def test_creep_in_the_records_is_not_excluded(gamma: float) -> None:
    assert hidden_after(3, Creep, stage=STAGE.with_effect(Creep(gamma=gamma, tau_max=1e4))) == {"creep"}
