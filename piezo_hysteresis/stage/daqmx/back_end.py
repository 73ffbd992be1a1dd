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

"""How a driver opens a stage on a National Instruments card."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ...parameter import Parameter, Row, Setting
from ..opening import Opening
from ..stage import Stage
from .setup import DaqmxSetup
from .stage import DaqmxStage

_DAQMX = DaqmxSetup(device="-", max_slew_rate=1.0)
"""Set-up whose values are the defaults."""

PARAMETERS: tuple[Row, ...] = (
    Setting("device", "", "name of the card, as NI MAX shows it"),
    Setting("output", _DAQMX.output, "analogue output that drives the amplifier"),
    Setting("displacement_input", _DAQMX.displacement_input, "analogue input of the position sensor"),
    Setting("voltage_input", _DAQMX.voltage_input, "analogue input of the amplifier's monitor; empty: none"),
    Setting("server", _DAQMX.server, "host:port of an NI gRPC device server; empty: the driver on this machine"),
    Parameter("sample_period_min", "", "s", _DAQMX.sample_period_min, 1e-9, 1.0, "shortest sample period", "the card"),
    Parameter(
        "lead",
        "",
        "s",
        _DAQMX.lead,
        1e-3,
        10.0,
        "duration of the output in the buffer, which is the latency",
        "the machine",
    ),
    Parameter("voltage_min", "u_min", "V", _DAQMX.voltage_min, -10.0, 10.0, "lowest drive voltage", "rig"),
    Parameter("voltage_max", "u_max", "V", _DAQMX.voltage_max, -10.0, 10.0, "highest drive voltage", "rig"),
    Parameter("max_slew_rate", "S", "V/s", 0.0, 0.0, 1e12, "steepest drive; required", "rig"),
    Parameter("safe_voltage", "u_s", "V", 0.0, -10.0, 10.0, "drive voltage of the stage at rest", "rig"),
    Setting(
        "assume_safe",
        _DAQMX.assume_safe,
        "true: take the output to be at safe_voltage at the start if neither the card nor a monitor can report it",
    ),
    Parameter(
        "amplifier_gain", "G_a", "V/V", _DAQMX.amplifier_gain, -1e4, 1e4, "piezo voltage over drive voltage", "rig"
    ),
    Parameter("monitor_gain", "", "V/V", _DAQMX.monitor_gain, -1e3, 1e3, "monitor voltage over piezo voltage", "rig"),
    Parameter("sensor_gain", "", "m/V", _DAQMX.sensor_gain, -1.0, 1.0, "displacement over sensor voltage", "rig"),
    Parameter("voltage_tolerance", "", "V", 1.0, 1e-3, 1e3, "largest steady error of the piezo voltage", "rig"),
    Parameter("settling_time", "", "s", 0.01, 0.0, 10.0, "time the amplifier needs to follow a step", "rig"),
    Parameter("sensor_range", "", "V", _DAQMX.sensor_range, 1e-3, 10.0, "the inputs span ± this voltage", "the card"),
    Parameter(
        "io_delay", "", "s", 0.0, 0.0, 1.0, "delay of the card itself, from a loop-back measurement", "loop_back_delay"
    ),
    Parameter("timeout", "", "s", _DAQMX.timeout, 0.01, 600.0, "longest wait for samples or for a server", "network"),
)
"""Parameters of the driver, declared under ``nidaqmx.``."""


def open(values: Mapping[str, Any], opening: Opening) -> Stage:
    """Open a stage on a National Instruments card; raises StageError if it is missing or contradicts the values."""
    period = {"sample_period": opening.sample_period} if opening.sample_period else {}
    assumed = {"assume_safe": values["assume_safe"] and opening.assumes_voltage}
    return DaqmxStage(DaqmxSetup(**{**values, **period, **assumed}))
