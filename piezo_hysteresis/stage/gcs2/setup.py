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

"""`Gcs2Setup`: how a stage is wired to a GCS 2.0 controller, and all properties that differ between controllers."""

from __future__ import annotations

import math
from dataclasses import dataclass

from ...errors import StageError
from ...parameter import slew_text


@dataclass(frozen=True, slots=True)
class Gcs2Setup:
    """Wiring, scales and limits of one axis. Those marked [U] are not verified on a device: see docs/hardware.md.

    Parameters
    ----------
    host, port
        Address and TCP port of the controller.
    axis : str
        Axis identifier, as ``SAI?`` lists it.
    channel : int
        Output channel of the piezo, for ``VOL?``, ``VMI?``, ``VMA?`` and record option 7.
    generator, wave_table : int
        Wave generator of the axis and the wave table it plays.
    voltage_table, displacement_table : int
        Recorder tables that are used.
    voltage_option, displacement_option : int
        Record options of piezo voltage [U] and actual position.
    amplifier_gain : float
        Piezo voltage over drive voltage [V/V]; 1 if the drive is the piezo voltage itself.
    command_per_volt, command_at_zero : float
        Open-loop command of ``SVA`` and of wave points: command = command_at_zero + command_per_volt × piezo voltage
        [U]; it may be volts or µm.
    position_unit : float
        Length of one unit of ``POS?`` [m].
    safe_voltage : float
        Drive voltage of the stage at rest [V].
    max_slew_rate : float
        Steepest drive [V/s], and rate of the ramp to the safe voltage unless a driver sets a lower one; required.
    voltage_tolerance : float
        Largest steady difference between requested and measured piezo voltage [V].
    settling_time : float
        Time that amplifier and ``VOL?`` need to follow a step [s].
    points_per_command : int
        Wave points in one ``WAV`` line; the longest line a controller takes is not documented [U].
    rows_per_answer : int
        Number of recorded samples per query.
    read_back : bool
        Read the wave table back and compare it before anything moves.
    longest_wave : int
        Number of points of the wave table; 0 to query it by ``WMS?``, which not all controllers know [U].
    longest_multiple : int
        Largest multiple of the servo time that can be a sample period [U].
    servo_time_parameter, recorder_parameter : int
        Numbers of the controller parameters that hold the servo time and the number of recorder points of all tables
        together. The defaults are those of an E-727; other controllers have other numbers [U].
    timeout : float
        Longest time without an answer of the controller [s].

    Raises
    ------
    StageError
        If a value is impossible.
    """

    host: str
    port: int = 50000
    axis: str = "1"
    channel: int = 1
    generator: int = 1
    wave_table: int = 1
    voltage_table: int = 1
    displacement_table: int = 2
    voltage_option: int = 7
    displacement_option: int = 2
    amplifier_gain: float = 1.0
    command_per_volt: float = 1.0
    command_at_zero: float = 0.0
    position_unit: float = 1e-6
    safe_voltage: float = 0.0
    max_slew_rate: float = 0.0
    voltage_tolerance: float = 1.0
    settling_time: float = 0.01
    points_per_command: int = 10
    rows_per_answer: int = 4096
    read_back: bool = True
    longest_wave: int = 0
    longest_multiple: int = 1000
    servo_time_parameter: int = 0x0E000200
    recorder_parameter: int = 0x16000200
    timeout: float = 2.0

    def __post_init__(self) -> None:
        if not self.host:
            raise StageError("gcs2.host: got no host, expected name or address of the controller")
        for name in (
            "port", "channel", "generator", "wave_table", "voltage_table", "displacement_table", "points_per_command",
            "rows_per_answer", "longest_multiple", "timeout", "voltage_tolerance", "position_unit",
        ):  # fmt: skip
            if not getattr(self, name) > 0:
                raise StageError(f"gcs2.{name}: got {getattr(self, name)!r}, expected more than 0")
        if not 0 < self.max_slew_rate < math.inf:
            raise StageError(
                f"gcs2.max_slew_rate: got {slew_text(self.max_slew_rate)}, expected the steepest drive that the "
                "amplifier and the stage allow, more than 0 and finite; from the amplifier's current I and the piezo's "
                "capacitance C it is I/C, divided by amplifier_gain"
            )
        for name in ("amplifier_gain", "command_per_volt"):
            if not (math.isfinite(getattr(self, name)) and getattr(self, name) != 0):
                raise StageError(f"gcs2.{name}: got {getattr(self, name)!r}, expected a number other than 0")
        if self.voltage_table == self.displacement_table:
            raise StageError(f"gcs2: got table {self.voltage_table} for voltage and displacement, expected two tables")

    def command(self, drive: float) -> float:
        """Open-loop command for a drive voltage [V]."""
        return self.command_at_zero + self.command_per_volt * self.amplifier_gain * drive
