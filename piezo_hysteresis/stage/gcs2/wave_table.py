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

"""`WaveTable`: waveforms to the wave table of a GCS 2.0 controller, point by point or drawn by the controller."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

import numpy as np

from ...errors import StoppedError
from ..description import Samples
from .array_answer import ArrayAnswer
from .client import Client
from .connection import Gcs2Error
from .setup import Gcs2Setup

_PROBE_POINTS = 50
"""Number of points of the test line that shows whether the controller can draw lines."""


class WaveTable:
    """The wave table that is overwritten, and all transfers of many samples.

    Parameters
    ----------
    client : Client
    setup : Gcs2Setup

    Attributes
    ----------
    is_interrupted : callable
        Called between two messages of a transfer.
    limits : tuple of float
        Lowest and highest piezo voltage [V].
    """

    def __init__(self, client: Client, setup: Gcs2Setup) -> None:
        self.client, self.setup = client, setup
        self.is_interrupted: Callable[[], bool] = bool
        self.limits = (0.0, 0.0)
        self._draws_lines: bool | None = None

    def require_not_interrupted(self) -> None:
        """Raise StoppedError once a stop has been requested."""
        if self.is_interrupted():
            raise StoppedError(f"{self.client.connection.place}: stopped before the waveform was played and read")

    @contextmanager
    def uninterrupted(self) -> Iterator[None]:
        """Do not interrupt the transfers within the block; `is_interrupted` is called all the same."""
        watched = self.is_interrupted
        self.is_interrupted = lambda: watched() and False
        try:
            yield
        finally:
            self.is_interrupted = watched

    def load(self, drive: Samples) -> None:
        """Write a waveform of drive voltages [V] into the wave table, and read it back if `read_back` is set."""
        s = self.setup
        points = s.command_at_zero + s.command_per_volt * s.amplifier_gain * drive
        self._write(points)
        if s.read_back:
            self._compare(points)

    def _write(self, points: Samples) -> None:
        s = self.setup
        self.client.command(f"WCL {s.wave_table}")
        for first in range(0, points.size, s.points_per_command):
            self.require_not_interrupted()
            chunk = points[first : first + s.points_per_command]
            values = " ".join(f"{point:.9g}" for point in chunk)
            self.client.command(f"WAV {s.wave_table} {'&' if first else 'X'} PNT {first + 1} {chunk.size} {values}")
        self._require_stored(points.size)

    def _require_stored(self, count: int) -> None:
        stored = self.client.whole(f"WAV? {self.setup.wave_table} 1")
        if stored != count:
            raise Gcs2Error(f"{self.client.connection.place}: stored {stored} wave points, expected {count}")

    def _compare(self, points: Samples) -> None:
        stored = np.concatenate([a.values[:, 0] for a in self.arrays("GWD?", points.size, (self.setup.wave_table,))])
        tolerance = 1e-5 * max(float(np.abs(points).max()), 1.0)
        differs = np.abs(stored - points) > tolerance
        if differs.any():
            at = int(differs.argmax())
            raise Gcs2Error(
                f"{self.client.connection.place}: wave point {at + 1} reads back as {stored[at]:g}, expected "
                f"{points[at]:g}; lower points_per_command"
            )

    def load_line(self, line: Samples) -> None:
        """Write drive voltages on a straight line [V].

        If the test line has shown that it can, the controller draws the line. Point by point takes much longer.
        """
        s = self.setup
        if self.draws_lines:
            begin, end = s.command(float(line[0])), s.command(float(line[-1]))
            self.client.command(_drawn(s.wave_table, line.size, begin, end))
            self._require_stored(line.size)
        else:
            self._write(s.command_at_zero + s.command_per_volt * s.amplifier_gain * line)

    @property
    def draws_lines(self) -> bool:
        """Whether ``WAV … LIN`` makes a straight line: tried once in the wave table, nothing moves."""
        if self._draws_lines is None:
            s, client = self.setup, self.client
            begin, end = (s.command_per_volt * voltage + s.command_at_zero for voltage in self.limits)
            try:
                client.command(_drawn(s.wave_table, _PROBE_POINTS, begin, end))
                drawn = client.array(f"GWD? 1 {_PROBE_POINTS} {s.wave_table}", _PROBE_POINTS, 1).values[:, 0]
            except Gcs2Error:
                if not client.connection.is_open:
                    raise
                self._draws_lines = False  # it refuses that kind of curve
            else:
                self._draws_lines = _is_line(drawn, begin, end)
        return self._draws_lines

    def arrays(self, question: str, count: int, tables: tuple[int, ...]) -> Iterator[ArrayAnswer]:
        """Answers to a question for `count` rows of some tables, `rows_per_answer` at a time."""
        numbers = " ".join(str(table) for table in tables)
        for first in range(1, count + 1, self.setup.rows_per_answer):
            self.require_not_interrupted()
            rows = min(self.setup.rows_per_answer, count + 1 - first)
            yield self.client.array(f"{question} {first} {rows} {numbers}", rows, len(tables))


def _drawn(table: int, count: int, begin: float, end: float) -> str:
    """The command that lets a controller draw a line into a wave table."""
    return f"WAV {table} X LIN {count} {end - begin:.9g} {begin:.9g} {count} 0 0"


def _is_line(points: Samples, begin: float, end: float) -> bool:
    """Whether points go from `begin` to `end`, or to one step before it, in equal steps."""
    step = (end - begin) / (points.size - 1)
    tolerance = 1e-5 * max(abs(begin), abs(end), 1.0)
    return (
        abs(points[0] - begin) <= tolerance
        and abs(points[-1] - end) <= abs(step) + tolerance
        and bool((np.abs(np.diff(points) - step) <= 0.1 * abs(step) + tolerance).all())
    )
