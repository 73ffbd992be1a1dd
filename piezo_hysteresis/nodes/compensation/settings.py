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

"""Parameters of the compensation node."""

from __future__ import annotations

from ...parameter import Parameter, Row, Setting

_SOURCE = "compensation node"
"""Source of the bounds of the parameters."""

COMPENSATION: tuple[Row, ...] = (
    Setting("model_file", "", "path of the first model; a model on the topic `model` replaces it between trajectories"),
    Setting("driver", "driver_node", "name of the driver node in the same namespace"),
    Setting(
        "play",
        True,
        "false: a trajectory is planned for ~/plan, and nothing moves",
    ),
    Setting("approximate", False, "leave out effects that cannot be inverted instead of refusing the model"),
    Setting("learning_rounds", 2, "corrections that ~/learn plays", lower=0, upper=100),
    Parameter(
        "sensor_noise",
        "σ",
        "m",
        0.0,
        0.0,
        1e-3,
        "rms noise of the sensor, at which learning stops; 0: taken from the samples while the drive is held",
        _SOURCE,
    ),
    Parameter(
        "approach",
        "t_a",
        "s",
        0.1,
        1e-3,
        1e3,
        "duration of the way to the first sample of a path, at least 200 samples",
        _SOURCE,
    ),
    Parameter(
        "way_back",
        "t_b",
        "s",
        0.0,
        0.0,
        1e3,
        "duration of the way back to the voltage before the path; 0: the last displacement is held",
        _SOURCE,
    ),
    Parameter("longest_trajectory", "t_max", "s", 120.0, 1e-3, 1e5, "longer ones are refused", _SOURCE),
    Parameter("integral_time", "t_i", "s", 0.0, 0.0, 1e6, "slow integral behind set_displacement; 0: off", _SOURCE),
)
"""Parameters of the node."""
