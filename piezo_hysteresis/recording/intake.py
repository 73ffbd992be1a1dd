"""`Intake`: samples on their way from a large file into memory, selected and averaged before they are kept."""

from __future__ import annotations

from array import array
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ..errors import RecordingError
from ..record import Samples
from .layout import Layout

MOST = 1 << 26
"""Samples that are kept of a recording: 1 GB of voltage and displacement, some 5 GB while they are judged."""


@dataclass(slots=True)
class Intake:
    """Columns that grow block by block.

    Parameters
    ----------
    width : int
        Number of columns.
    start, stop : int
        First row to keep and the one after the last; no stop keeps all.
    average : int
        Rows averaged into one; an incomplete last group is dropped.

    Raises
    ------
    RecordingError
        Where more than `MOST` samples would be kept.

    Examples
    --------
    >>> intake = Intake(1, start=1, stop=7, average=2)
    >>> intake.add(np.arange(4.0)[:, None]), intake.add(np.arange(4.0, 9.0)[:, None]), intake.column(0).tolist()
    (None, None, [1.5, 3.5, 5.5])
    """

    width: int
    start: int = 0
    stop: int | None = None
    average: int = 1
    rows: int = 0
    _columns: list[array[float]] = field(default_factory=list)
    _rest: NDArray[np.float64] = field(default_factory=lambda: np.empty((0, 0)))

    def __post_init__(self) -> None:
        self._columns = [array("d") for _ in range(self.width)]
        self._rest = np.empty((0, self.width))

    @classmethod
    def of(cls, width: int, layout: Layout) -> Intake:
        """For columns of which a layout keeps a part."""
        start, stop = layout.from_the_beginning
        return cls(width, start, stop, layout.average)

    @property
    def is_full(self) -> bool:
        """True once no further row is wanted."""
        return self.stop is not None and self.rows >= self.stop

    def add(self, values: Samples) -> None:
        """Take a block of rows, shape (n, width)."""
        first = self.rows
        self.rows += len(values)
        stop = len(values) if self.stop is None else max(0, self.stop - first)
        values = values[max(0, self.start - first) : stop]
        if self.average > 1:
            values = np.concatenate((self._rest, values))
            whole = len(values) // self.average * self.average
            self._rest = values[whole:].copy()
            values = values[:whole].reshape(-1, self.average, self.width).mean(axis=1)
        if self.width and len(self._columns[0]) + len(values) > MOST:
            raise RecordingError(
                f"got more than {MOST} samples, expected fewer; choose a part by rows, or average while reading"
            )
        for column, part in zip(self._columns, values.T, strict=True):
            column.frombytes(np.ascontiguousarray(part).tobytes())

    def kept_row(self, row: int) -> int:
        """Where a row of the file has come to lie; that of the first one kept for rows before it."""
        return max(0, row - self.start) // self.average

    def column(self, at: int) -> Samples:
        """A column as it has been kept.

        Raises
        ------
        RecordingError
            Where a part was asked for that holds no sample.
        """
        if not self._columns[at] and (self.start or self.stop is not None):
            asked = f"{self.start}:{'' if self.stop is None else self.stop}"
            raise RecordingError(f"rows: got {asked}, expected a part of {self.rows} rows that is not empty")
        return np.frombuffer(self._columns[at], np.float64)
