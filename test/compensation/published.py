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

"""The stage of the benchmarks in small: a loop, and an ARX of eight with zeros outside the circle."""

from __future__ import annotations

import numpy as np

from piezo_hysteresis.effects import Arx, BoucWen, Effect
from piezo_hysteresis.model.model import Model

PERIOD = 2e-5
ARX = Arx(
    a=[-0.05847, 0.2423, -0.05833, -0.4917, 0.4170, -0.1945, 0.07748, -0.01198],
    b=[0.004481, 0.04629, 0.1320, 0.1154, -0.02198, -0.06236, -0.0007691, 0.01408],
    delay=3,
)


def stage(*effects: Effect) -> Model:
    """Model with a range of about 20 µm under 0 to 10 V."""
    return Model((BoucWen(), ARX, *effects), PERIOD, 10.0, 4e-5, {"free_run_error": "5e-09"})


def triangle(frequency: float, low: float, high: float, cycles: float) -> np.ndarray:
    """Displacement [m] from `low` up and down."""
    t = np.arange(round(cycles / frequency / PERIOD)) * PERIOD
    return low + (high - low) * (1.0 - np.abs(2.0 * ((t * frequency) % 1.0) - 1.0))


def swing(frequency: float, low: float, high: float, cycles: float) -> np.ndarray:
    """Displacement [m] from `low` up and down without a kink."""
    t = np.arange(round(cycles / frequency / PERIOD)) * PERIOD
    return low + (high - low) * 0.5 * (1.0 - np.cos(2.0 * np.pi * frequency * t))
