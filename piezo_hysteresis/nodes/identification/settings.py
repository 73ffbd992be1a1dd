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

"""Parameters of the identification node, and the protocols that they name."""

from __future__ import annotations

from collections.abc import Callable

from ...discrepancy.choice.time_to_decide import ERROR_RATE, LONGEST
from ...identification.protocol.drive_limits import DriveLimits
from ...identification.protocol.protocol import Protocol, paper, rich, short
from ...parameter import Parameter, Row, Setting

PROTOCOLS: dict[str, Callable[[DriveLimits, int], Protocol]] = {"paper": paper, "short": short, "rich": rich}
"""Words of the parameter `protocol`."""

IDENTIFICATION: tuple[Row, ...] = (
    Setting("protocol", "short", "protocol to play to the stage", tuple(PROTOCOLS)),
    Setting("seed", 0, "seed of the random waveforms of the protocol", lower=0, upper=2**31 - 1),
    Setting("driver", "driver_node", "name of the driver node in the same namespace; read at start"),
    Setting("experiment", "", "recording for ~/diagnose, inside experiment_root; empty: the last one"),
    Setting("live", False, "true: ~/diagnose drives the stage until it is sure; false: it reads a recording"),
    Parameter("error_rate", "α", "1", ERROR_RATE, 1e-6, 0.49, "wrong answers accepted with live", "gap finder"),
    Parameter("stage_time", "T_max", "s", LONGEST, 15.0, 1e5, "longest time of driving with live", "gap finder"),
    Setting(
        "experiment_root", "", "folder of the recordings, read at start; empty: ~/.ros/piezo_hysteresis/<namespace>"
    ),
)
"""Parameters of the identification node."""
