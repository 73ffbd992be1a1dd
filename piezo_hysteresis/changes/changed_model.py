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

"""`changed_model`: a given model with its changed parameter."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..effects import ExtraResonance, Softening, ThermalDrift
from ..identification.records.noise_floor import stroke
from ..model.model import Model
from ..online.change.score import loop_heights
from ..record import Record
from .change_kinds import ParameterChange
from .signatures import DRIFT_TIME, creep_numbers, shaped_model


def changed_model(model: Model, change: ParameterChange, records: Sequence[Record]) -> Model:
    """The given model with the change, and with the new gain and loop height."""
    values = model.values()
    gain, loop = change.session.get("gain", 0.0), change.session.get("loop", 0.0)
    numbers = {n: v * (1.0 + loop) for n, v in loop_heights(model).items()} if loop else {}
    if change.added is not None:
        model = change.added(model, change.size)
    elif change.kind.family == "lag":
        model = shaped_model(model, change.key, change.size)
    elif change.kind.name == ExtraResonance.name:
        name = f"{ExtraResonance.name}.f0"
        numbers[name] = values[name] + change.size
    elif change.kind.name == ThermalDrift.name:
        longest = max(r.duration for r in records)
        tau = max(1.0, DRIFT_TIME * longest)
        model = model.with_effect(ThermalDrift(D=-change.size / float(np.expm1(-longest / tau)), tau=tau))
    elif change.kind.name == Softening.name:
        # the coefficient applies to the cube of the displacement, the fit used the cube of the drive
        span = stroke(records)
        cubic = next((n for n in model.hysteresis.linear_numbers() if n == "p1"), None)
        if cubic is not None:
            top = max(float(np.abs(r.voltage).max()) for r in records) / model.voltage_scale
            slope = span / model.displacement_scale / top
            name = f"{model.hysteresis.name}.{cubic}"
            numbers[name] = values[name] - change.size * slope**3 * (model.displacement_scale / span) ** 2
    else:
        numbers |= {
            n: v * (1.0 + change.size) for n, v in creep_numbers(model).items() if change.key not in ("gain", "loop")
        }
    model = model.with_values(numbers)
    return replace(model, displacement_scale=model.displacement_scale * (1.0 + gain))
