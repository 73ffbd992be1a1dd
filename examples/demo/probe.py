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

"""The waveform on which the live residual is compared, the same before and after every new model."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from piezo_hysteresis.identification.protocol.drive_limits import DriveLimits
from piezo_hysteresis.identification.protocol.excitation import hold, mixture, sine, steps, triangle


def probe(limits: DriveLimits) -> dict[str, NDArray[np.float64]]:
    """Slow loops, a fast sine, levels held, and a random mixture [V], by name: 8 s that are not used in any fit."""
    parts = {
        "slow loops": triangle(limits, (1.0, 0.6), 1.0),
        "200 Hz": sine(limits, 200.0, 0.3, centre=0.5, amplitude=0.4),
        "levels held": steps(limits, (0.2, 0.8, 0.4), 1.0, slew_rate=limits.ramp_rate),
        "rest": hold(limits, 0.0, 0.5),
        "random mixture": mixture(limits, 1.5, seed=12345),
    }
    return {name: limits.from_safe_to_safe(part) for name, part in parts.items()}
