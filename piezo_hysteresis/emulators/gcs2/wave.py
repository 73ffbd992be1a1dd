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

"""`WaveGenerator`: wave tables and generator of an emulated controller."""

from __future__ import annotations

import numpy as np

from ...stage.description import Samples
from ...stage.gcs2.error_number import NO_WAVE_SELECTED, OUT_OF_RANGE, SYNTAX, WAVE_TOO_LARGE, WRONG_COUNT
from .refusal import Refusal

_LONGEST_RUN = 10_000_000
"""Largest number of servo cycles of one run; the whole output is computed before it is played."""


class WaveGenerator:
    """Wave tables by number, and the settings of the generator that plays them.

    Parameters
    ----------
    tables : int
        Number of tables.
    longest : int
        Largest number of points of a table.
    lowest, highest : float
        Limits of a point [unit of the open-loop command].
    """

    def __init__(self, tables: int, longest: int, lowest: float, highest: float) -> None:
        self.longest = longest
        self._limits = lowest, highest
        self.numbers = range(1, tables + 1)
        self._points: dict[int, list[float]] = {table: [] for table in self.numbers}
        self.table, self.cycles, self.rate, self.offset, self.mode = 0, 0, 1, 0.0, 0

    def clear(self, table: int) -> None:
        """Empty a table."""
        self.points(table).clear()

    def points(self, table: int) -> list[float]:
        """Points of a table."""
        if table not in self._points:
            raise Refusal(OUT_OF_RANGE)
        return self._points[table]

    def write(self, words: list[str]) -> None:
        """Carry out ``WAV table X|& PNT first count values…`` or ``WAV table X|& LIN …``; other curves are refused."""
        if len(words) < 6:
            raise Refusal(WRONG_COUNT)
        table, mode, kind, *rest = words
        if kind.upper() not in ("PNT", "LIN") or mode.upper() not in ("X", "&"):
            raise Refusal(OUT_OF_RANGE)
        try:
            stored = self.points(int(table))
            numbers = _points(rest) if kind.upper() == "PNT" else _line(rest)
        except ValueError:
            raise Refusal(SYNTAX) from None
        low, high = self._limits
        if not all(low <= number <= high for number in numbers):
            raise Refusal(OUT_OF_RANGE)
        if mode.upper() == "X":
            stored.clear()
        if len(stored) + len(numbers) > self.longest:
            raise Refusal(WAVE_TOO_LARGE)
        stored.extend(numbers)

    def waveform(self) -> Samples:
        """The commands that the generator plays, one per servo cycle, shape (n,); endless output is refused."""
        points = self._points.get(self.table, [])
        if not points:
            raise Refusal(NO_WAVE_SELECTED)
        if self.cycles < 1 or self.cycles * self.rate * len(points) > _LONGEST_RUN:
            raise Refusal(OUT_OF_RANGE)
        return np.tile(np.repeat(np.array(points) + self.offset, self.rate), self.cycles)


def _points(words: list[str]) -> list[float]:
    first, count, *values = words
    if int(first) < 1 or int(count) != len(values):
        raise Refusal(WRONG_COUNT)
    return [float(value) for value in values]


def _line(words: list[str]) -> list[float]:
    """Points of a straight line over the whole segment; the last point is one step before its end."""
    segment, amplitude, offset, wave, first, speed_up = (float(word) for word in words)
    if not 1 <= segment == wave or first or speed_up:
        raise Refusal(OUT_OF_RANGE)
    if segment > _LONGEST_RUN:
        raise Refusal(WAVE_TOO_LARGE)
    steps = np.arange(int(segment)) / segment
    return [float(point) for point in offset + amplitude * steps]
