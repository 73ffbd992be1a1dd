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

"""`NpyArrays`: the columns of a NumPy array in an ``.npy`` file."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.lib.format import MAGIC_PREFIX
from numpy.typing import NDArray

from ...errors import RecordingError
from ..segmentation.decimating_buffer import DecimatingBuffer
from ..table.read_options import ReadOptions
from .named_arrays import NamedArrays


class NpyArrays(NamedArrays):
    """Column to array: fields of a structured array by their names, columns of a matrix by their numbers from 1.

    Parameters
    ----------
    path : Path
        The file; only the requested columns are read.

    Raises
    ------
    RecordingError
        If it is no NumPy file, holds pickled objects, or its array is neither structured nor a matrix of columns.
    """

    kind = "the columns"

    def __init__(self, path: Path) -> None:
        with path.open("rb") as file:
            if file.read(len(MAGIC_PREFIX)) != MAGIC_PREFIX:
                raise RecordingError("got other first bytes than a NumPy array has, expected a file of numpy.save")
        array = np.load(path, mmap_mode="r", allow_pickle=False)
        if array.dtype.names is not None and array.ndim == 1:
            self._columns = {name: array[name] for name in array.dtype.names}
        elif array.dtype.names is None and array.ndim == 2:
            long = array.T if array.shape[0] < array.shape[1] else array
            self._columns = {str(at + 1): long[:, at] for at in range(min(long.shape[1], 1000))}
        else:
            raise RecordingError(f"got an array of shape {array.shape}, expected one with a column for each channel")

    def close(self) -> None:
        self._columns = {}

    def __iter__(self) -> Iterator[str]:
        return iter(self._columns)

    def __getitem__(self, name: str) -> NDArray[Any]:
        return np.asarray(self._columns[name])

    def shape(self, name: str) -> tuple[int, ...]:
        return self._columns[name].shape

    def samples(self, name: str, column: int | None, options: ReadOptions) -> DecimatingBuffer:
        values = self._columns[name]
        self.check_column(name, column)
        return self.in_pieces(name, values.size, options, lambda part: np.asarray(values[part]))
