"""`Axis`: what one axis of a GCS 2.0 controller can be asked and told, in drive volts and metres."""

from __future__ import annotations

import time
from collections.abc import Iterator

import numpy as np

from ..description import Description, Samples
from .array import GcsArray
from .client import Client
from .connection import Connection, Gcs2Error
from .setup import Gcs2Setup

NEEDED = (
    "#9", "#24", "DRC", "DRL?", "DRR?", "ERR?", "POS?", "RTR", "SAI?", "SPA?", "SVA", "SVO", "SVO?", "TNR?", "VMA?",
    "VMI?", "VOL?", "WAV", "WAV?", "WCL", "WGC", "WGO", "WOS", "WSL", "WTR",
)  # fmt: skip
"""Commands without which an axis cannot be driven."""

_SAMPLE_TIME_TOLERANCE = 1e-3
"""Relative difference up to which two sample times are one."""


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

    def identify(self) -> Description:
        """Ask the controller who it is and for its limits; nothing moves.

        Raises
        ------
        Gcs2Error
            If it lacks a command or the axis, or answers what cannot be.
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
        self.servo_time = client.number(f"SPA? {s.axis} 0x{s.servo_time_parameter:08X}")
        low, high = sorted(client.number(f"{q} {s.channel}") / s.amplifier_gain for q in ("VMI?", "VMA?"))
        return Description(
            name=f"{name}, axis {s.axis}",
            streaming=False,
            sample_period_min=self.servo_time,
            sample_period_max=self.servo_time * s.longest_multiple,
            sample_period_step=self.servo_time,
            voltage_min=low,
            voltage_max=high,
            max_slew_rate=s.max_slew_rate,
            safe_voltage=min(max(s.safe_voltage, low), high),
            longest_block=self._longest_block("WMS?" in known),
            amplifier_gain=s.amplifier_gain,
            measured_voltage=True,
        )

    def _longest_block(self, tells_wave_memory: bool) -> int:
        s, client = self.setup, self.client
        recorded = client.whole(f"SPA? {s.axis} 0x{s.recorder_parameter:08X}") // max(client.whole("TNR?"), 1)
        if s.longest_wave or not tells_wave_memory:
            played = s.longest_wave or recorded
        else:
            played = client.whole(f"WMS? {s.wave_table}")
        if min(recorded, played) < 1:
            raise Gcs2Error(
                f"{client.connection.place}: got {recorded} recorder and {played} wave points, expected some of each"
            )
        return min(recorded, played)

    def voltage(self) -> float:
        """Drive voltage measured at the piezo [V]."""
        return self.client.number(f"VOL? {self.setup.channel}") / self.setup.amplifier_gain

    def displacement(self) -> float:
        """Position [m]."""
        return self.client.number(f"POS? {self.setup.axis}") * self.setup.position_unit

    def open_loop(self) -> None:
        """Switch the servo off and make sure that it is off.

        Raises
        ------
        Gcs2Error
            If the servo stays on.
        """
        self.client.command(f"SVO {self.setup.axis} 0")
        self.require_servo_off("after it was switched off")

    def require_servo_off(self, when: str) -> None:
        """Gcs2Error if the servo is on."""
        if self.client.whole(f"SVO? {self.setup.axis}"):
            raise Gcs2Error(
                f"{self.client.connection.place}: the servo of axis {self.setup.axis} is on {when}, expected off; "
                "look for another program, a macro or an analogue input that switches it"
            )

    def set_voltage(self, drive: float) -> None:
        """Command one drive voltage [V] and wait until the piezo has it."""
        self.client.command(f"SVA {self.setup.axis} {self.setup.command(drive):.9g}")
        self.require_voltage(drive)

    def require_voltage(self, drive: float) -> None:
        """Gcs2Error unless ``VOL?`` reaches the drive voltage [V] within the settling time."""
        tolerance = self.setup.voltage_tolerance / abs(self.setup.amplifier_gain)
        due = time.monotonic() + self.setup.settling_time
        while abs((measured := self.voltage()) - drive) > tolerance:
            left = due - time.monotonic()
            if left <= 0:
                raise Gcs2Error(
                    f"{self.client.connection.place}: measured a drive of {measured:g} V, expected {drive:g} V within "
                    f"{tolerance:g} V; saturated, or check amplifier_gain, command_per_volt and command_at_zero"
                )
            time.sleep(min(left, 2e-3))

    def load(self, drive: Samples) -> None:
        """Write a waveform of drive voltages [V] into the wave table, and read it back if the setup says so."""
        s = self.setup
        points = s.command_at_zero + s.command_per_volt * s.amplifier_gain * drive
        self.client.command(f"WCL {s.wave_table}")
        for first in range(0, points.size, s.points_per_command):
            chunk = points[first : first + s.points_per_command]
            values = " ".join(f"{point:.9g}" for point in chunk)
            self.client.command(f"WAV {s.wave_table} {'&' if first else 'X'} PNT {first + 1} {chunk.size} {values}")
        stored = self.client.whole(f"WAV? {s.wave_table} 1")
        if stored != points.size:
            raise Gcs2Error(f"{self.client.connection.place}: stored {stored} wave points, expected {points.size}")
        if s.read_back:
            self._compare(points)

    def _compare(self, points: Samples) -> None:
        stored = np.concatenate([a.values[:, 0] for a in self._arrays("GWD?", points.size, (self.setup.wave_table,))])
        tolerance = 1e-5 * max(float(np.abs(points).max()), 1.0)
        differs = np.abs(stored - points) > tolerance
        if differs.any():
            at = int(differs.argmax())
            raise Gcs2Error(
                f"{self.client.connection.place}: wave point {at + 1} reads back as {stored[at]:g}, expected "
                f"{points[at]:g}; lower points_per_command"
            )

    def arm(self, multiple: int) -> None:
        """Set generator and recorder for one run at `multiple` servo times per sample."""
        s = self.setup
        for text in (
            f"WSL {s.generator} {s.wave_table}",
            f"WOS {s.generator} 0",
            f"WGC {s.generator} 1",
            f"WTR {s.generator} {multiple} 0",
            f"RTR {multiple}",
            f"DRC {s.voltage_table} {s.channel} {s.voltage_option}",
            f"DRC {s.displacement_table} {s.axis} {s.displacement_option}",
        ):
            self.client.command(text)

    def start(self) -> None:
        """Start the generator, and with it the recorder."""
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
            If the recorder holds another number of samples, at another period, or what cannot be samples.
        """
        s, place = self.setup, self.client.connection.place
        tables = (s.voltage_table, s.displacement_table)
        for table in tables:
            held = self.client.whole(f"DRL? {table}")
            if held < count:
                raise Gcs2Error(f"{place}: recorder table {table} holds {held} samples, expected {count}")
        parts: list[Samples] = []
        for array in self._arrays("DRR?", count, tables):
            told = array.sample_time
            if told is None or abs(told / sample_period - 1) > _SAMPLE_TIME_TOLERANCE:
                raise Gcs2Error(f"{place}: recorded every {told} s, expected {sample_period:g} s; check the servo time")
            if parts and np.array_equal(array.values, parts[-1]) and np.ptp(array.values[:, 1]) > 0:
                raise Gcs2Error(f"{place}: got the same {len(parts[-1])} recorded samples twice; read again")
            parts.append(array.values)
        values = np.concatenate(parts)
        return values[:, 0] / s.amplifier_gain, values[:, 1] * s.position_unit

    def _arrays(self, question: str, count: int, tables: tuple[int, ...]) -> Iterator[GcsArray]:
        numbers = " ".join(str(table) for table in tables)
        for first in range(1, count + 1, self.setup.rows_per_answer):
            rows = min(self.setup.rows_per_answer, count + 1 - first)
            yield self.client.array(f"{question} {first} {rows} {numbers}", rows, len(tables))
