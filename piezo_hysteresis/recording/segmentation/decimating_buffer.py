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

"""`DecimatingBuffer`: selects and averages the samples of a large file while they are read."""

from __future__ import annotations

from array import array
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...errors import RecordingError, counted
from ...record import Notice, Samples
from ..table.read_options import ReadOptions

PIECE = 1 << 18
"""Number of values that are processed together."""

ENOUGH = 1 << 24
"""Largest number of samples of a recording without averaging by default; checking them takes less than 2 GB."""

MOST = 1 << 26
"""Largest number of samples at a rate that the user chose; checking them takes about 5 GB."""


def averaged_notice(average: int, sample_period: float, phase: str = "") -> Notice:
    """Notice about a long recording that was averaged; `sample_period` [s] is the resulting one."""
    return Notice(
        "averaged",
        f"the recording has more than {ENOUGH} samples; {average} were averaged into one, to a sample period of "
        f"{sample_period:g} s; motion above {0.5 / sample_period:.3g} Hz is lost; to keep it, "
        "choose a part by `rows`, which is read at the full rate, or set `average` to 1",
        phase,
    )


def left_out_notice(size: int, average: int, phase: str = "") -> Notice:
    """Notice about a record that is too short for the average."""
    text = f"a record of {counted(size, 'sample')} was left out, because {average} are averaged into one"
    return Notice("left_out", text, phase)


def shared_averages(sizes: Sequence[int], average: int | None) -> list[int]:
    """Number of samples averaged into one in each of several phases; the longest phases are averaged first.

    Parameters
    ----------
    sizes : sequence of int
        Samples of every phase.
    average : int or None
        Average chosen by the user.

    Raises
    ------
    RecordingError
        Where more than `MOST` samples would be kept.

    Examples
    --------
    >>> shared_averages([2000, 30_000_000], None), shared_averages([9, 9], 3)
    ([1, 2], [3, 3])
    """
    if average is not None:
        if sum(size // average for size in sizes) > MOST:
            raise _too_many()
        return [average] * len(sizes)
    averages = [1] * len(sizes)
    while sum(size // n for size, n in zip(sizes, averages, strict=True)) > ENOUGH:
        longest = max(range(len(sizes)), key=lambda i: sizes[i] // averages[i])
        averages[longest] *= 2
    return averages


def _too_many() -> RecordingError:
    return RecordingError(
        f"got more than {MOST} samples, expected fewer; choose a part by `rows`, or a larger `average`"
    )


@dataclass(slots=True)
class DecimatingBuffer:
    """Columns that grow block by block.

    Parameters
    ----------
    width : int
        Number of columns.
    start, stop : int
        First row to keep and the one after the last; None keeps all.
    average : int or None
        Rows averaged into one; an incomplete last group is dropped. None begins with 1 and doubles whenever `ENOUGH`
        rows are kept: the time of doubling does not matter, because the mean of two means is the mean of all.

    Raises
    ------
    RecordingError
        Where more than `MOST` samples would be kept of a given `average`.

    Examples
    --------
    >>> buffer = DecimatingBuffer(1, start=1, stop=7, average=2)
    >>> buffer.add(np.arange(4.0)[:, None]), buffer.add(np.arange(4.0, 9.0)[:, None]), buffer.column(0).tolist()
    (None, None, [1.5, 3.5, 5.5])
    """

    width: int
    start: int = 0
    stop: int | None = None
    average: int | None = 1
    rows: int = 0
    factor: int = 1
    """Present number of rows averaged into one."""
    _columns: list[array[float]] = field(default_factory=list)
    _rest: NDArray[np.float64] = field(default_factory=lambda: np.empty((0, 0)))

    def __post_init__(self) -> None:
        self.factor = self.average or 1
        self._columns = [array("d") for _ in range(self.width)]
        self._rest = np.empty((0, self.width))

    @classmethod
    def of(cls, width: int, options: ReadOptions) -> DecimatingBuffer:
        """Buffer for columns of which the options select a part."""
        start, stop = options.from_the_beginning
        return cls(width, start, stop, options.average)

    @property
    def is_full(self) -> bool:
        """True when all selected rows have been read."""
        return self.stop is not None and self.rows >= self.stop

    def add(self, values: Samples) -> None:
        """Add a block of rows, shape (n, width)."""
        first = self.rows
        self.rows += len(values)
        stop = len(values) if self.stop is None else max(0, self.stop - first)
        values = values[max(0, self.start - first) : stop]
        if len(self._rest):
            values = np.concatenate((self._rest, values))
        most = ENOUGH if self.average is None else MOST
        while len(values) >= self.factor and self.width:
            kept = len(self._columns[0])
            if kept >= most:
                if self.average is not None:
                    raise _too_many()
                self._halve()
                continue
            whole = min(len(values) // self.factor, most - kept) * self.factor
            self._keep(values[:whole])
            values = values[whole:]
        self._rest = values.copy()

    def add_column(self, values: NDArray[Any]) -> None:
        """Add numbers of one column, shape (n,), in pieces."""
        for first in range(0, values.size, PIECE):
            self.add(values[first : first + PIECE].astype(np.float64, copy=False)[:, None])

    def _keep(self, values: Samples) -> None:
        if self.factor > 1:
            values = values.reshape(-1, self.factor, self.width).mean(axis=1)
        for column, part in zip(self._columns, values.T, strict=True):
            column.frombytes(np.ascontiguousarray(part).tobytes())

    def _halve(self) -> None:
        self.factor *= 2
        half = len(self._columns[0]) // 2
        for column in self._columns:
            values = np.frombuffer(column, np.float64)
            values[:half] = (values[0 : 2 * half : 2] + values[1 : 2 * half : 2]) / 2.0
            del values  # an array with a view cannot be resized
            del column[half:]

    def kept_row(self, row: int) -> int:
        """Position of a row of the file in the buffer; rows before the first selected one have its position."""
        return max(0, row - self.start) // self.factor

    def column(self, at: int) -> Samples:
        """A column of the buffer.

        Raises
        ------
        RecordingError
            If the selected part holds no sample, or fewer than are averaged into one.
        """
        if not self._columns[at] and self.factor > 1:
            raise RecordingError(f"`average`: got {self.factor}, expected at most {len(self._rest)} samples")
        if not self._columns[at] and (self.start or self.stop is not None):
            asked = f"{self.start}:{'' if self.stop is None else self.stop}"
            raise RecordingError(f"`rows`: got {asked}, expected a part of {self.rows} rows that is not empty")
        return np.frombuffer(self._columns[at], np.float64)
