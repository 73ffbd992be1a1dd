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

"""`Axis`: the commands and queries of one axis of a GCS 2.0 controller, in drive volts and metres."""

from __future__ import annotations

import time

import numpy as np

from ..description import Description, Samples
from .client import Client
from .connection import Connection, Gcs2Error
from .setup import Gcs2Setup
from .wave_table import WaveTable

NEEDED = (
    "#9", "#24", "DRC", "DRL?", "DRR?", "ERR?", "POS?", "RTR", "SAI?", "SPA?", "SVA", "SVO", "SVO?", "TNR?", "VMA?",
    "VMI?", "VOL?", "WAV", "WAV?", "WCL", "WGC", "WGO", "WOS", "WSL", "WTR",
)  # fmt: skip
"""Commands without which an axis cannot be driven."""

_SAMPLE_TIME_TOLERANCE = 1e-3
"""Relative difference up to which two sample times count as equal."""
_HIGHEST_VOLTAGE = 1e4
"""Voltage above which an answer of the controller is impossible [V]."""
_SERVO_TIMES = (1e-6, 0.1)
"""Range outside which a servo time is impossible [s]."""
_LONGEST_TRAVEL = 0.1
"""Position beyond which an answer of the controller is impossible [m]."""
_POLL = 5e-3
"""Time between two queries whether the generator is running [s]."""


class Axis:
    """One axis of a controller; the link is opened on first use.

    Parameters
    ----------
    setup : Gcs2Setup
    """

    def __init__(self, setup: Gcs2Setup) -> None:
        self.setup = setup
        self.client = Client(Connection(setup.host, setup.port, setup.timeout))
        self.servo_time = 0.0
        self.waves = WaveTable(self.client, setup)
        self._plausible = (-_HIGHEST_VOLTAGE, _HIGHEST_VOLTAGE)
        self._travel = (-_LONGEST_TRAVEL / setup.position_unit, _LONGEST_TRAVEL / setup.position_unit)

    def identify(self) -> Description:
        """Query identity and limits of the controller; nothing moves.

        Raises
        ------
        Gcs2Error
            If a command or the axis is missing, or an answer is impossible.
        """
        s, client = self.setup, self.client
        name = client.value("*IDN?")
        known = {line.split()[0].upper() for line in client.ask("HLP?") if line}
        missing = [command for command in NEEDED if command not in known]
        if missing:
            raise Gcs2Error(
                f"{name}: does not know {' '.join(missing)}, expected a controller with wave generator and recorder"
            )
        axes = client.ask("SAI?")
        if s.axis not in axes:
            raise Gcs2Error(f"{name}: has the axes {' '.join(axes)}, expected '{s.axis}' among them; set gcs2.axis")
        self.servo_time = client.number(f"SPA? {s.axis} 0x{s.servo_time_parameter:08X}", *_SERVO_TIMES)
        lowest, highest = (client.number(f"{q} {s.channel}", *self._plausible) for q in ("VMI?", "VMA?"))
        if not lowest < highest:
            raise Gcs2Error(f"{name}: answers {lowest:g} V to VMI? and {highest:g} V to VMA?, expected a range")
        self.waves.limits, span = (lowest, highest), highest - lowest
        self._plausible = (lowest - span / 2, highest + span / 2)
        if {"TMN?", "TMX?"} <= known:
            self._narrow_travel()
        low, high = sorted((lowest / s.amplifier_gain, highest / s.amplifier_gain))
        return Description(
            name=f"{name}, axis {s.axis}",
            streaming=False,
            sample_period_min=self.servo_time,
            sample_period_max=self.servo_time * s.longest_multiple,
            sample_period_step=self.servo_time,
            voltage_min=low,
            voltage_max=high,
            max_slew_rate=s.max_slew_rate,
            safe_voltage=s.safe_voltage,
            longest_block=self._longest_block("WMS?" in known),
            amplifier_gain=s.amplifier_gain,
            measured_voltage=True,
        )

    def _narrow_travel(self) -> None:
        """Accept positions up to one travel range beyond its ends, because an open-loop stage may pass them."""
        first, last = (self.client.number(f"{q} {self.setup.axis}", *self._travel) for q in ("TMN?", "TMX?"))
        if first < last:
            self._travel = (2 * first - last, 2 * last - first)

    def _longest_block(self, reports_wave_memory: bool) -> int:
        s, client = self.setup, self.client
        recorded = client.whole(f"SPA? {s.axis} 0x{s.recorder_parameter:08X}") // max(client.whole("TNR?"), 1)
        if s.longest_wave or not reports_wave_memory:
            played = s.longest_wave or recorded
        else:
            played = client.whole(f"WMS? {s.wave_table}")
        if min(recorded, played) < 2:
            raise Gcs2Error(
                f"{client.connection.place}: got {recorded} recorder and {played} wave points, expected two of each"
            )
        return min(recorded, played)

    def voltage(self) -> float:
        """Drive voltage measured at the piezo [V]."""
        return self.client.number(f"VOL? {self.setup.channel}", *self._plausible) / self.setup.amplifier_gain

    def take_over(self, voltage: float) -> float:
        """Try how the controller draws lines; a generator that plays the table is ended. Returns the voltage [V]."""
        if self.is_playing():
            self.client.command(f"WGO {self.setup.generator} 0")
            voltage = self.voltage()
        _ = self.waves.draws_lines
        return voltage

    def displacement(self) -> float:
        """Position [m]."""
        return self.client.number(f"POS? {self.setup.axis}", *self._travel) * self.setup.position_unit

    def open_loop(self, expected: float | None = None) -> None:
        """Switch the servo off and make sure that it is off, and that the drive voltage is the expected one [V].

        Raises
        ------
        Gcs2Error
            If the servo stays on, or another program has moved the stage, so that a motion would begin with a step.
        """
        self.client.command(f"SVO {self.setup.axis} 0")
        self.require_servo_off("after it was switched off")
        if expected is not None:
            self.require_voltage(expected)

    def require_servo_off(self, when: str) -> None:
        """Gcs2Error if the servo is on."""
        if self.client.whole(f"SVO? {self.setup.axis}"):
            raise Gcs2Error(
                f"{self.client.connection.place}: the servo of axis {self.setup.axis} is on {when}, expected off; "
                "check for another program, a macro or an analogue input that switches it on"
            )

    def set_voltage(self, drive: float) -> None:
        """Command one drive voltage [V]: a step of one servo cycle."""
        self.client.command(f"SVA {self.setup.axis} {self.setup.command(drive):.9g}")

    def follow(self, line: Samples) -> None:
        """Play drive voltages on a straight line [V], one per servo cycle, and return when they have been played."""
        s = self.setup
        self.waves.load_line(line)
        self._select(1)
        self.start()
        time.sleep(line.size * self.servo_time)
        due = time.monotonic() + s.timeout
        while self.is_playing():
            if time.monotonic() > due:
                raise Gcs2Error(f"{self.client.connection.place}: still plays {s.timeout:g} s after the end of a ramp")
            time.sleep(_POLL)
        # another program may have stopped it on the way; a line that the controller draws ends a full step early
        self.require_voltage(float(line[-1]), margin=abs(float(line[1] - line[0])))
        self.set_voltage(float(line[-1]))

    def require_voltage(self, drive: float, margin: float = 0.0) -> None:
        """Gcs2Error unless ``VOL?`` reaches the drive voltage [V] in the settling time, within tolerance and margin."""
        tolerance = self.setup.voltage_tolerance / abs(self.setup.amplifier_gain) + margin
        due = time.monotonic() + self.setup.settling_time
        while abs((measured := self.voltage()) - drive) > tolerance:
            left = due - time.monotonic()
            if left <= 0:
                raise Gcs2Error(
                    f"{self.client.connection.place}: measured a drive of {measured:g} V, expected {drive:g} V within "
                    f"{tolerance:g} V; another program moves the stage, the amplifier is saturated, or amplifier_gain, "
                    "command_per_volt or command_at_zero is wrong"
                )
            time.sleep(min(left, 2e-3))

    def arm(self, multiple: int) -> None:
        """Set generator and recorder for one run at `multiple` servo times per sample."""
        s = self.setup
        self.waves.require_not_interrupted()
        self._select(multiple)
        for text in (
            f"RTR {multiple}",
            f"DRC {s.voltage_table} {s.channel} {s.voltage_option}",
            f"DRC {s.displacement_table} {s.axis} {s.displacement_option}",
        ):
            self.client.command(text)

    def _select(self, multiple: int) -> None:
        """Let the generator play the wave table once, at `multiple` servo times per point."""
        s = self.setup
        for text in (
            f"WSL {s.generator} {s.wave_table}",
            f"WOS {s.generator} 0",
            f"WGC {s.generator} 1",
            f"WTR {s.generator} {multiple} 0",
        ):
            self.client.command(text)

    def start(self) -> None:
        """Start the generator, and with it the recorder, unless a stop has been requested."""
        self.waves.require_not_interrupted()
        self.client.command(f"WGO {self.setup.generator} 1")

    def is_playing(self) -> bool:
        """True while the generator runs."""
        return bool(self.client.generators_running() >> (self.setup.generator - 1) & 1)

    def stop(self) -> None:
        """Stop generator and motion where they are."""
        self.client.stop()
        self.client.command(f"WGO {self.setup.generator} 0")

    def record(self, count: int, sample_period: float) -> tuple[Samples, Samples]:
        """Drive voltage [V] and displacement [m] of the last run.

        Raises
        ------
        Gcs2Error
            If the recorder holds another number of samples, at another period, or values that cannot be samples.
        """
        s, place = self.setup, self.client.connection.place
        tables = (s.voltage_table, s.displacement_table)
        for table in tables:
            held = self.client.whole(f"DRL? {table}")
            if held < count:
                raise Gcs2Error(f"{place}: recorder table {table} holds {held} samples, expected {count}")
        parts: list[Samples] = []
        for array in self.waves.arrays("DRR?", count, tables):
            period = array.sample_time
            if period is None or abs(period / sample_period - 1) > _SAMPLE_TIME_TOLERANCE:
                got = "without a sample time" if period is None else f"every {period:g} s"
                raise Gcs2Error(f"{place}: recorded {got}, expected {sample_period:g} s; check the servo time")
            if parts and np.array_equal(array.values, parts[-1]) and np.ptp(array.values[:, 1]) > 0:
                raise Gcs2Error(f"{place}: got the same {len(parts[-1])} recorded samples twice; read again")
            parts.append(array.values)
        values = np.concatenate(parts)
        outside = (values[:, 1] < self._travel[0]) | (values[:, 1] > self._travel[1])
        if outside.any():
            at = int(outside.argmax())
            raise Gcs2Error(
                f"{place}: recorded position {at} is {values[at, 1]:g}, expected {self._travel[0]:g} to "
                f"{self._travel[1]:g}; position_unit is wrong, or the channels are exchanged"
            )
        return values[:, 0] / s.amplifier_gain, values[:, 1] * s.position_unit
