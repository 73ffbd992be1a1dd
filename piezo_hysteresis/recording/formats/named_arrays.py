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

"""`NamedArrays`: base of the readers of files that contain arrays under names."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Callable, Mapping
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from ...errors import RecordingError
from ..segmentation.decimating_buffer import PIECE, DecimatingBuffer
from ..table.read_options import ReadOptions


class NamedArrays(Mapping[str, NDArray[Any]]):
    """Mapping of dotted names to arrays. It is a context manager, and the file is open until it ends."""

    kind = "the variables"
    """Word for the names in messages."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __contains__(self, name: object) -> bool:
        return name in set(self)  # the default of a mapping would read the array

    def __len__(self) -> int:
        return sum(1 for _ in self)

    def title(self, name: str) -> str:
        """Name of an array, with its unit in parentheses where the file states one beside the name."""
        return name

    @abstractmethod
    def shape(self, name: str) -> tuple[int, ...]:
        """Shape of an array, with the axes ordered as in MATLAB."""

    @abstractmethod
    def close(self) -> None:
        """Close the file, and release what was read from it."""

    @abstractmethod
    def samples(self, name: str, column: int | None, options: ReadOptions) -> DecimatingBuffer:
        """The samples of a vector, or of one column of a matrix, as `options` select and average them.

        Parameters
        ----------
        name : str
            Dotted name.
        column : int or None
            Column, counted from 0, with the axes ordered as in MATLAB.
        options : ReadOptions
            Its `rows`, where they count from the beginning, and its `average` apply.

        Raises
        ------
        RecordingError
            If the array holds no real numbers, has no such column, or has several columns and none is chosen.
        """

    @staticmethod
    def in_pieces(
        name: str, size: int, options: ReadOptions, piece: Callable[[slice], NDArray[Any]]
    ) -> DecimatingBuffer:
        """A column that is read in pieces, so that its length is not limited by the memory.

        Parameters
        ----------
        name : str
            Of the array, for messages.
        size : int
            Length of the column.
        options : ReadOptions
            Pieces outside its `rows` are skipped.
        piece : callable
            From a slice of the column to its numbers.

        Raises
        ------
        RecordingError
            If they are not real numbers.
        """
        buffer = DecimatingBuffer.of(1, options)
        for first in range(0, size, PIECE):
            part = slice(first, min(first + PIECE, size))
            is_wanted = part.stop > buffer.start
            values = np.asarray(piece(part)) if is_wanted else np.empty(part.stop - first)
            if values.dtype.kind not in "fiub":
                raise RecordingError(f"{name}: got {values.dtype}, expected real numbers")
            buffer.add_column(values)
            if buffer.is_full:
                break
        return buffer

    def check_column(self, name: str, column: int | None) -> None:
        """Raise RecordingError if an array has no such column, or has several and none is chosen."""
        shape = self.shape(name)
        if column is None and math.prod(shape) != max(shape, default=1):
            raise RecordingError(f"{name}: got shape {shape}, expected a vector; choose a column as {name}[1]")
        if column is not None and (len(shape) != 2 or column >= shape[1]):
            raise RecordingError(f"{name}: got shape {shape}, expected a matrix with a column {column + 1}")
