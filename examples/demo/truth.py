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

"""Hidden numbers of a simulated stage, as the numbers of a model that mean the same.

A stage states voltages at the piezo and corner frequencies, and its hysteresis in units of its own output w. A model
states voltages before the amplifier and time constants, and w in units of the displacement scale.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from piezo_hysteresis import Model
from piezo_hysteresis.stage.plant import PlantParameters


def in_numbers_of(model: Model, plant: PlantParameters, hidden: Mapping[str, float]) -> dict[str, float]:
    """Hidden numbers of a stage in the units of a model, by the names in the model, as far as both have them.

    The slope of the hysteresis at a turning point is the unit of w.
    """
    of_output = model.hysteresis.turning_slope / (plant.hysteresis.p2 + plant.hysteresis.A)
    factors = {
        "hysteresis.initial_state": ("initial_state.h0", of_output),
        "hysteresis.even2": ("even_input_polynomial.p_e", of_output),
        "hysteresis.backlash": ("backlash.b", 1.0),
        "electronics.amplifier_slew": ("amplifier_slew_limit.S", 1.0 / plant.electronics.amplifier_gain),
        "electronics.amplifier_max": ("amplifier_saturation.upper", 1.0 / plant.electronics.amplifier_gain),
    }
    found = {name: hidden[key] * factor for key, (name, factor) in factors.items() if key in hidden}
    if corner := hidden.get("electronics.amplifier_bandwidth"):
        found["amplifier_bandwidth.tau"] = 1.0 / (2.0 * np.pi * corner)
    named = {effect.public_name() for effect in model.effects}
    return {name: value for name, value in found.items() if name.partition(".")[0] in named}
