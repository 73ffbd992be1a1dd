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

"""`DriverSettings`: the parameters of the driver, as a table and as one frozen value."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import Any

from ..errors import ParameterError
from ..parameter import Parameter, Row, Setting, slew_text
from ..stage.back_ends import BACK_ENDS
from ..stage.stage import Description

_SOURCE = "driver"
"""Source of the parameters of the driver."""

LARGEST_STEP = 0.4
"""Largest change of the drive from one sample to the next if `max_slew_rate` is 0, as a share of the voltage range.

It is four thirds of the largest step of the identification protocols (0.3 of the range in one sample).
"""

DRIVER: tuple[Row, ...] = (
    Setting("stage", "simulated", "back end", tuple(BACK_ENDS)),
    Setting("autostart", True, "configure and activate at start"),
    Parameter(
        "sample_period", "T_s", "s", 0.0, 0.0, 10.0, "time between samples; 0: the default of the stage", _SOURCE
    ),
    Parameter("block_duration", "T_b", "s", 0.01, 1e-3, 1.0, "time covered by one message of samples", _SOURCE),
    Parameter("live_rate", "f_l", "Hz", 50.0, 0.1, 1000.0, "rate of voltage, displacement and live", _SOURCE),
    Parameter(
        "voltage_min",
        "u_min",
        "V",
        0.0,
        -1e4,
        1e4,
        "lowest drive voltage; if both limits are 0, those of the stage apply",
        _SOURCE,
    ),
    Parameter(
        "voltage_max",
        "u_max",
        "V",
        0.0,
        -1e4,
        1e4,
        "highest drive voltage; if both limits are 0, those of the stage apply",
        _SOURCE,
    ),
    Parameter(
        "max_slew_rate",
        "S_max",
        "V/s",
        0.0,
        0.0,
        1e12,
        "steepest drive; 0: 0.4 of the range per sample, or ramp_rate if that is steeper",
        _SOURCE,
    ),
    Parameter(
        "ramp_rate", "S_r", "V/s", 50.0, 1e-3, 1e9, "rate of ramps to set-points and to the safe voltage", _SOURCE
    ),
    Parameter(
        "hold_timeout",
        "T_h",
        "s",
        0.0,
        0.0,
        1e6,
        "time for which a voltage is held before the ramp to the safe voltage; 0: no limit",
        _SOURCE,
    ),
    Parameter("command_max_age", "T_c", "s", 2.0, 0.0, 1e6, "largest age of a command that is played", _SOURCE),
    Parameter(
        "claim_timeout", "T_o", "s", 10.0, 2.0, 600.0, "time without a renewal after which a claim ends", _SOURCE
    ),
    Parameter(
        "real_time_factor", "κ", "1", 1.0, 0.01, 1000.0, "speed of a simulated or replayed stage; 1: real time", _SOURCE
    ),
    Parameter(
        "keeper_timeout",
        "T_k",
        "s",
        1.0,
        0.0,
        60.0,
        "time without a heartbeat after which the keeper brings a device to its safe voltage; 0: no keeper",
        _SOURCE,
    ),
    Setting(
        "frame_id", "", "frame of the displacement in all headers; empty: the namespace, or 'stage' if there is none"
    ),
    Parameter("discovery_time", "T_d", "s", 0.5, 0.0, 30.0, "wait for another driver of the same topics", _SOURCE),
)
"""Parameters of the driver. The parameters of a back end have the prefix ``"<word>."``."""

IN_FORCE: tuple[Row, ...] = (
    Setting("stage", "", "name of the stage"),
    Parameter("sample_period", "T_s", "s", 0.0, 0.0, math.inf, "time between samples", _SOURCE),
    Parameter("voltage_min", "u_min", "V", 0.0, -math.inf, math.inf, "lowest drive voltage", _SOURCE),
    Parameter("voltage_max", "u_max", "V", 0.0, -math.inf, math.inf, "highest drive voltage", _SOURCE),
    Parameter("safe_voltage", "u_0", "V", 0.0, -math.inf, math.inf, "voltage of the stage at rest", _SOURCE),
    Parameter("max_slew_rate", "S_max", "V/s", 0.0, 0.0, math.inf, "steepest drive", _SOURCE),
    Parameter(
        "ramp_rate", "S_r", "V/s", 0.0, 0.0, math.inf, "rate of ramps to set-points and to the safe voltage", _SOURCE
    ),
    Setting("stopped", False, "true after ~/stop, until ~/release"),
)
"""Values in use while the driver is configured, with the prefix ``"in_force."``; planners read them."""


@dataclass(frozen=True, slots=True)
class DriverSettings:
    """Values of the parameters in `DRIVER`, by name and in their units."""

    stage: str
    autostart: bool
    sample_period: float
    block_duration: float
    live_rate: float
    voltage_min: float
    voltage_max: float
    max_slew_rate: float
    ramp_rate: float
    hold_timeout: float
    command_max_age: float
    claim_timeout: float
    real_time_factor: float
    keeper_timeout: float
    discovery_time: float

    @classmethod
    def from_values(cls, values: Mapping[str, Any]) -> DriverSettings:
        """The settings from a mapping of parameter names to values, which may contain others."""
        return cls(**{field.name: values[field.name] for field in fields(cls)})

    def limits(self, stage: Description, sample_period: float) -> Description:
        """The description of a stage with the limits of this driver; waveforms may have any length.

        Parameters
        ----------
        stage : Description
            Description of the stage.
        sample_period : float
            Sample period in use [s]; `LARGEST_STEP` is a change per sample.

        Raises
        ------
        ParameterError
            If the limits of the driver exceed those of the stage, or exclude its safe voltage.
        """
        if stage.ignores_drive:
            return stage
        low, high = self.voltage_min, self.voltage_max
        if low == high == 0.0:
            low, high = stage.voltage_min, stage.voltage_max
        if not stage.voltage_min <= low <= stage.safe_voltage <= high <= stage.voltage_max:
            raise ParameterError(
                f"voltage_min, voltage_max: got {low:g} to {high:g} V, expected them inside {stage.voltage_min:g} to "
                f"{stage.voltage_max:g} V of {stage.name} and around its safe voltage {stage.safe_voltage:g} V"
            )
        usual = max(LARGEST_STEP * (high - low) / sample_period, self.ramp_rate)
        slew = self.max_slew_rate or min(usual, stage.max_slew_rate)
        if slew > stage.max_slew_rate:
            raise ParameterError(
                f"max_slew_rate: got {slew_text(slew)}, expected at most the {slew_text(stage.max_slew_rate)} "
                f"of {stage.name}"
            )
        if self.ramp_rate > slew:
            raise ParameterError(
                f"ramp_rate: got {slew_text(self.ramp_rate)}, expected at most the slew rate {slew_text(slew)}; "
                "lower ramp_rate or raise max_slew_rate"
            )
        return replace(stage, voltage_min=low, voltage_max=high, max_slew_rate=slew, longest_block=None)

    @property
    def slowest_rate(self) -> float:
        """Rate that keeps `ramp_rate` and `max_slew_rate` [V/s], also where these contradict one another."""
        return min(self.ramp_rate, self.max_slew_rate or math.inf)

    def block_size(self, sample_period: float) -> int:
        """Number of samples per message, at least one."""
        return max(1, round(self.block_duration / sample_period))

    def longest_ramp(self, limits: Description) -> float:
        """Duration of the longest ramp to the safe voltage [s]."""
        largest = max(limits.voltage_max - limits.safe_voltage, limits.safe_voltage - limits.voltage_min)
        return math.ceil(largest / self.ramp_rate / self.real_time_factor)

    def in_force(self, limits: Description, sample_period: float) -> dict[str, float | str | bool]:
        """The values in use with these limits and this sample period [s], by the names of `IN_FORCE`."""
        return {
            "stage": limits.name,
            "sample_period": sample_period,
            "voltage_min": limits.voltage_min,
            "voltage_max": limits.voltage_max,
            "safe_voltage": limits.safe_voltage,
            "max_slew_rate": limits.max_slew_rate,
            "ramp_rate": self.ramp_rate,
        }
