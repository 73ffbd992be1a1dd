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

"""Compile every numba kernel once, so that nodes start in seconds; numba keeps the machine code beside the sources."""

from __future__ import annotations

import numpy as np

from piezo_hysteresis.compensation import Inverse
from piezo_hysteresis.effects import (
    BASELINE,
    CATALOGUE,
    FINER_FORMS,
    MEMORY,
    UNNAMED,
    Arx,
    BoucWen,
    HysteresisExponent,
    Offset,
    PublishedBoucWen,
)
from piezo_hysteresis.model.model import Model
from piezo_hysteresis.record import Record
from piezo_hysteresis.stage.simulated import SimulatedStage

PERIOD = 2e-5
DRIVE = 3.0 + np.sin(np.arange(64.0))

arx = Arx(a=(-1.6, 0.8), b=(0.1, 0.1), delay=3)
eighth = Arx(a=(-1.6, 0.8, *(0.0,) * 6), b=(0.1, 0.1, *(0.0,) * 6), delay=3)
base = Model((BoucWen(), arx, Offset()), PERIOD)
models = [base, base.with_effect(eighth), Model((PublishedBoucWen(), arx), PERIOD)]
models += [base.with_effect(effect()) for effect in (*CATALOGUE, *UNNAMED) if effect not in BASELINE]
models += [base.with_effect(MEMORY()).with_effect(effect()) for effect in FINER_FORMS]
models.append(base.with_effect(HysteresisExponent(n=1.5)))
for model in models:
    for period in (PERIOD, 1e-3):
        record = Record(DRIVE, DRIVE, period)
        model.simulate(record)
        model.sensitivities(record, list(model.values()))
    Inverse(model, approximate=True).run(1e-3 * DRIVE, Inverse(model, approximate=True).rest(0.0))
SimulatedStage().play(DRIVE)
