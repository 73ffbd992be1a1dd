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

"""The next experiment: the drive that would separate two explanations that the data do not distinguish."""

from __future__ import annotations

import math

import numpy as np

from ...identification.protocol.drive_limits import DriveLimits
from ...identification.protocol.phases import ProtocolPhase
from ...identification.training.training_data import TrainingData
from ...record import CONDITIONING
from ..search.selection_result import Selection
from .tiers import spare_drives, tiers
from .time_to_decide import ERROR_RATE, LONGEST, Separation, best_drive, missing_log_odds

FINEST = 1e-5
"""Shortest sample period of the drives to choose from [s]."""


def best_next_experiment(selection: Selection, training_data: TrainingData) -> Separation | None:
    """The drive that best separates an accepted effect from its rival; None if no effect has one."""
    for step in selection.accepted:
        if step.confusable_with:
            rival = next(r for r in step.rivals if r.effect.public_name() == step.confusable_with[0])
            missing = missing_log_odds({step.best.name: 0.5, rival.name: 0.5}, ERROR_RATE)
            found = best_drive((step.best, rival), possible_drives(training_data), missing, LONGEST)
            return None if found is None else found[1]
    return None


def possible_drives(training_data: TrainingData) -> tuple[ProtocolPhase, ...]:
    """The drives of a live diagnosis inside the recorded range and slew rate of the voltage, from its lower end."""
    extent, records = training_data.extent, training_data.records
    low, high = extent.voltage_min, extent.voltage_max
    period = min(r.sample_period for r in records)
    before = [r.voltage[0] if r.continues else r.settled_voltage for r in records]  # a jump may be the first sample
    steps = [np.diff(r.voltage, prepend=v) / r.sample_period for r, v in zip(records, before, strict=True)]
    steepest = max(float(np.abs(s).max()) for s in steps)
    limits = DriveLimits(period * math.ceil(FINEST / period), low, high, low, steepest, min(steepest, extent.span))
    drives = (*(p for tier in tiers(limits) for p in tier.phases), *spare_drives(limits))
    return tuple(d for d in drives if d.name != CONDITIONING)
