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

"""`ReadOptions`: options for reading a recording, for information that the file does not contain."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from ...channel_mapping import quantity_of
from ...errors import RecordingError
from ...record import Samples
from .units import REVERSED, si_factor

CHANNELS = ("time", "voltage", "displacement")
"""Channels that a recording must have, unless its sample period is given; `is_channel` decides about further ones."""

LONGEST_PERIOD = 60.0
"""Sample period that may be given by hand [s]; a larger number is a rate in Hz."""

LABELS = ("phase", "record", "continues", "truncated", "initial_voltage", "sample_period", "start_time")
"""Properties that are constant within a record."""

IDLE, HOLD = "idle", "hold"
"""Names of the time before the first and after every phase of a bag."""
LEFT_OUT = (IDLE, HOLD)
"""Phases that are left out unless `ReadOptions.include` names them."""

Column = str | int
"""Title or name of a column, or its number from 1."""


def is_channel(name: str) -> bool:
    """True for the name of a column of numbers: ``time``, or one that holds a quantity (`quantity_of`).

    >>> is_channel("other_displacement"), is_channel("monitor_voltage"), is_channel("initial_voltage")
    (True, True, False)
    """
    return name == "time" or quantity_of(name) is not None


@dataclass(frozen=True)
class ReadOptions:
    """Places of the channels of a recording, and information that the file does not contain.

    Parameters
    ----------
    axis : str, optional
        Namespace of one stage in a bag that holds several, e.g. ``"/stage_x"``; several with commas between are read as
        one stage of several axes.
    columns : mapping of str to str or int
        Channel (see `is_channel`) or label (one of `LABELS`) to its place: a column number counted from 1, the name of
        a column, key or variable, or ``/topic.field[element]`` in a bag.
    units : mapping of str to str or float
        Channel to its unit (``um``, ``nm``, ``mV``, ``ms``, …) or to the SI value of one count. A minus before it, or
        alone for the unit in the file, reverses a channel: ``-um``, ``-``.
    sample_period : float, optional
        Time between samples [s]; it replaces that of the file.
    initial_voltage : float, optional
        Voltage at which the stage had settled before every phase that does not continue another [V].
    rows : (int, int), optional
        First sample and the one after the last of a table or of a record in one piece; as a Python slice. Without its
        first samples, and without `initial_voltage`, a record is `truncated`.
    phases : str or sequence of (float, str), optional
        Name of the only phase, or start time [s] and name of each one; default: names proposed from the data.
    average : int, optional
        Number of samples averaged into one while they are read. Default: 1, and for a recording that is too long for
        the memory the smallest number that is enough. A given 1 keeps every sample, or the recording is refused.
    include : sequence of str
        Phases to keep that are otherwise left out: ``idle``, ``hold``.

    Raises
    ------
    RecordingError
        On an unknown channel or unit, or an impossible number.
    """

    axis: str | None = None
    columns: Mapping[str, Column] = field(default_factory=dict)
    units: Mapping[str, str | float] = field(default_factory=dict)
    sample_period: float | None = None
    initial_voltage: float | None = None
    rows: tuple[int | None, int | None] | None = None
    phases: str | Sequence[tuple[float, str]] | None = None
    include: Sequence[str] = ()
    average: int | None = None

    def __post_init__(self) -> None:
        for option, name in (*(("columns", c) for c in self.columns), *(("units", c) for c in self.units)):
            if not (is_channel(name) or name in LABELS):
                raise RecordingError(
                    f"`{option}`: got channel '{name}', expected one of {', '.join((*CHANNELS, *LABELS))}, "
                    "or another name with voltage, displacement or temperature in it, e.g. displacement_2"
                )
        for name, unit in self.units.items():
            si_factor(name, unit)
        if self.sample_period is not None and not (math.isfinite(self.sample_period) and self.sample_period > 0):
            raise RecordingError(f"`sample_period`: got {self.sample_period!r} s, expected a positive time")
        if (self.sample_period or 0.0) > LONGEST_PERIOD:
            given = float(self.sample_period or 1.0)
            raise RecordingError(
                f"`sample_period`: got {given:g} s, expected at most {LONGEST_PERIOD:g} s between two samples; "
                f"if {given:g} Hz is the sample rate, give {1.0 / given:.6g}"
            )
        if unknown := [name for name in self.include if name not in LEFT_OUT]:
            raise RecordingError(f"`include`: got '{unknown[0]}', expected some of {', '.join(LEFT_OUT)}")
        if self.initial_voltage is not None and not math.isfinite(self.initial_voltage):
            raise RecordingError(f"`initial_voltage`: got {self.initial_voltage!r} V, expected a finite voltage")
        times = [] if self.phases is None or isinstance(self.phases, str) else [time for time, _ in self.phases]
        if not all(map(math.isfinite, times)):
            raise RecordingError(f"`phases`: got the times {', '.join(map(str, times))}, expected finite ones in s")
        if self.average is not None and self.average < 1:
            raise RecordingError(f"`average`: got {self.average}, expected a whole number of samples, 1 or more")
        first, last = self.rows or (None, None)
        if last is not None and (first or 0) >= last and ((first or 0) < 0) == (last < 0):
            raise RecordingError(f"`rows`: got {first or 0}:{last}, expected a part that is not empty")
        columns = {k: int(c) if isinstance(c, str) and c.isdigit() else c for k, c in self.columns.items()}
        for name, column in columns.items():
            if isinstance(column, int) and column < 1:
                raise RecordingError(f"`columns`: got {column} for {name}, expected a number counted from 1")
        object.__setattr__(self, "columns", columns)

    def in_si(self, channel: str, values: Samples, unit: str | None = None) -> Samples:
        """Values of a channel in SI units, by the given unit or else by the `unit` in the file."""
        given = self.units.get(channel, unit)
        if given == REVERSED:
            given = f"{REVERSED}{unit or ''}"
        factor = 1.0 if given is None else si_factor(channel, given)
        return values if factor == 1.0 else np.asarray(values * factor)

    @property
    def from_the_beginning(self) -> tuple[int, int | None]:
        """The part of `rows` that a reader can apply while it reads: bounds that do not count from the end."""
        start, stop = self.rows or (None, None)
        if (start or 0) < 0 or (stop is not None and stop < 0):
            return 0, None
        return start or 0, stop

    def after_reading(self, average: int) -> ReadOptions:
        """The part of `rows` that remains after `from_the_beginning` and the averaging."""
        rows = None if self.rows is None or self.from_the_beginning != (0, None) else self.rows
        period = None if self.sample_period is None else self.sample_period * average
        if rows is not None and average > 1:
            raise RecordingError(
                f"`rows`: got {self.rows} of a recording that is averaged, expected rows counted from the beginning"
            )
        return replace(self, rows=rows, sample_period=period, average=average)

    def part(self, size: int) -> slice:
        """`rows` as a slice of a record of `size` samples."""
        if self.rows is None:
            return slice(0, size)
        start, stop, _ = slice(*self.rows).indices(size)
        if stop <= start:
            raise RecordingError(f"`rows`: got {self.rows}, expected a part of {size} rows that is not empty")
        return slice(start, stop)

    def truncates(self, part: slice) -> bool:
        """True where a part of a record leaves its beginning, and so its initial state, unknown."""
        return bool(part.start) and self.initial_voltage is None

    @property
    def passes_over(self) -> bool:
        """True where reading begins after the first row, with an unknown initial state."""
        return bool(self.from_the_beginning[0]) and self.initial_voltage is None

    def with_period(self, sample_period: float | None) -> ReadOptions:
        """The same options with the sample period [s] that the file gives."""
        return replace(self, sample_period=sample_period)
