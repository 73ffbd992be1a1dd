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

"""How a driver opens a stage on a controller that speaks GCS 2.0."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ...parameter import Parameter, Row, Setting
from ..opening import Opening
from ..stage import Stage
from .setup import Gcs2Setup
from .stage import Gcs2Stage

_UNVERIFIED = "not verified on a device: docs/hardware.md"
"""Remark on parameters that were not yet checked with a real controller."""
_GCS2 = Gcs2Setup(host="-", max_slew_rate=1.0)
"""Set-up whose values are the defaults."""

PARAMETERS: tuple[Row, ...] = (
    Setting("host", "", "name or address of the controller"),
    Setting("port", _GCS2.port, "TCP port", lower=1, upper=65535),
    Setting("axis", _GCS2.axis, "axis identifier"),
    Setting("channel", _GCS2.channel, "output channel of the piezo", lower=1, upper=1000),
    Setting("generator", _GCS2.generator, "wave generator of the axis", lower=1, upper=1000),
    Setting("wave_table", _GCS2.wave_table, "wave table that is overwritten", lower=1, upper=100_000),
    Setting("voltage_table", _GCS2.voltage_table, "recorder table of the piezo voltage", lower=1, upper=1000),
    Setting("displacement_table", _GCS2.displacement_table, "recorder table of the position", lower=1, upper=1000),
    Setting(
        "voltage_option",
        _GCS2.voltage_option,
        f"record option of the piezo voltage; {_UNVERIFIED}",
        lower=0,
        upper=100_000,
    ),
    Setting("displacement_option", _GCS2.displacement_option, "record option of the position", lower=0, upper=100_000),
    Setting(
        "servo_time_parameter",
        _GCS2.servo_time_parameter,
        f"number of the controller parameter that holds the servo time; {_UNVERIFIED}",
        lower=0,
        upper=2**32 - 1,
    ),
    Setting(
        "recorder_parameter",
        _GCS2.recorder_parameter,
        f"number of the controller parameter that holds the recorder points; {_UNVERIFIED}",
        lower=0,
        upper=2**32 - 1,
    ),
    Setting(
        "points_per_command",
        _GCS2.points_per_command,
        f"wave points in one command; {_UNVERIFIED}",
        lower=1,
        upper=10_000,
    ),
    Setting("rows_per_answer", _GCS2.rows_per_answer, "recorded samples in one answer", lower=1, upper=2**20),
    Setting("read_back", _GCS2.read_back, "compare the wave table with what was sent before anything moves"),
    Setting(
        "longest_wave",
        _GCS2.longest_wave,
        f"points of the wave table; 0: ask the controller; {_UNVERIFIED}",
        lower=0,
        upper=2**31 - 1,
    ),
    Setting(
        "longest_multiple",
        _GCS2.longest_multiple,
        f"longest sample period, as a multiple of the servo time; {_UNVERIFIED}",
        lower=1,
        upper=2**31 - 1,
    ),
    Parameter(
        "amplifier_gain",
        "G_a",
        "V/V",
        1.0,
        -1e4,
        1e4,
        "piezo voltage over drive voltage; 1 if both are the same",
        "rig",
    ),
    Parameter(
        "command_per_volt", "c", "1/V", 1.0, -1e3, 1e3, f"open-loop command over piezo voltage; {_UNVERIFIED}", "rig"
    ),
    Parameter("command_at_zero", "c_0", "1", 0.0, -1e4, 1e4, f"open-loop command at 0 V; {_UNVERIFIED}", "rig"),
    Parameter("position_unit", "", "m", 1e-6, 1e-12, 1.0, "length of one unit of POS?", "manual of the controller"),
    Parameter("safe_voltage", "u_s", "V", 0.0, -1e4, 1e4, "drive voltage of the stage at rest", "rig"),
    Parameter("max_slew_rate", "S", "V/s", 0.0, 0.0, 1e12, "steepest drive; required", "rig"),
    Parameter("voltage_tolerance", "", "V", 1.0, 1e-3, 1e3, "largest steady error of the piezo voltage", "rig"),
    Parameter("settling_time", "", "s", 0.01, 0.0, 10.0, "time the piezo voltage needs to follow a step", "rig"),
    Parameter("timeout", "", "s", 2.0, 0.01, 600.0, "longest time without an answer of the controller", "network"),
)
"""Parameters of the driver, declared under ``gcs2.``."""


def open(values: Mapping[str, Any], opening: Opening) -> Stage:
    """Connect to a GCS 2.0 controller; raises StageError if it is missing or contradicts the values."""
    return Gcs2Stage(Gcs2Setup(**values))
