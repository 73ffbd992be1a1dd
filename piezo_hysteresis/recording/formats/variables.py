"""`Variables`: base of the readers of files that contain named arrays."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Mapping
from typing import Any, Self

from numpy.typing import NDArray

from ...errors import RecordingError
from ..segmentation.decimating_buffer import DecimatingBuffer
from ..table.read_options import ReadOptions


class Variables(Mapping[str, NDArray[Any]]):
    """Dotted name to array of every variable and field, as long as this is used as a context manager."""

    kind = "the variables"
    """What the names are, in messages."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __contains__(self, name: object) -> bool:
        return name in set(self)  # a mapping would read it to see

    def __len__(self) -> int:
        return sum(1 for _ in self)

    @abstractmethod
    def close(self) -> None:
        """Let go of the file, and of what was read of it."""

    @abstractmethod
    def samples(self, name: str, column: int | None, options: ReadOptions) -> DecimatingBuffer:
        """The one column of a vector, or a column of a matrix, as a layout keeps it.

        Parameters
        ----------
        name : str
            Dotted name.
        column : int or None
            Column in MATLAB, counted from 0.
        options : ReadOptions
            Its `rows`, where they count from the beginning, and its `average` apply.

        Raises
        ------
        RecordingError
            If there are no real numbers, no such column, or several where none is named.
        """

    @staticmethod
    def check_column(name: str, shape: tuple[int, ...], column: int | None) -> None:
        """RecordingError where an array of a shape, as in MATLAB, has no such column, or several and none is named."""
        if column is None and math.prod(shape) != max(shape, default=1):
            raise RecordingError(f"{name}: got shape {shape}, expected a vector; choose a column as {name}[1]")
        if column is not None and (len(shape) != 2 or column >= shape[1]):
            raise RecordingError(f"{name}: got shape {shape}, expected a matrix with that column")
