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

"""Identification: waveforms, the delay, the linear dynamics, the hysteresis, and a joint fit of all in free run.

`DriveLimits`, the waveforms of `excitation` and a `Protocol` of phases define what is played. `identify_delay`,
`identify_arx` and `fit_hysteresis` are the published steps, and `three_steps` runs all of them. Users call `identify`.
"""

from __future__ import annotations

from .fit.fit import Fit, fit
from .identification import Identification
from .identify import identify
from .protocol.drive_limits import DriveLimits
from .protocol.phases import ProtocolPhase
from .protocol.protocol import Protocol, paper, rich, short
from .steps.delay import Delay, identify_delay
from .steps.dynamics import Dynamics, identify_arx
from .steps.frequency_response import FrequencyResponse, periodic, welch
from .steps.hysteresis import fit_hysteresis
from .steps.order_choice import compare_orders
from .steps.three_steps import ThreeSteps, three_steps

__all__ = [
    "DriveLimits",
    "ProtocolPhase",
    "Protocol",
    "paper",
    "short",
    "rich",
    "Delay",
    "identify_delay",
    "Dynamics",
    "identify_arx",
    "compare_orders",
    "FrequencyResponse",
    "welch",
    "periodic",
    "fit_hysteresis",
    "ThreeSteps",
    "three_steps",
    "Fit",
    "fit",
    "Identification",
    "identify",
]
