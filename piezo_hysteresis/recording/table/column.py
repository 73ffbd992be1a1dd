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

"""`Column`: numbers that are added in blocks and may exceed the memory."""

from __future__ import annotations

import tempfile
import weakref
from typing import IO, Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from ..segmentation.decimating_buffer import ENOUGH, PIECE


class Column:
    """Numbers of one type. Beyond `ENOUGH` numbers they are stored in a temporary file that is mapped into memory.

    The file has no name and is deleted with the column. Its folder is ``TMPDIR``, which should not be a RAM disk.

    Parameters
    ----------
    kind : dtype_like
        Kind of the numbers.

    Examples
    --------
    >>> column = Column(np.uint32)
    >>> column.extend(np.arange(3)), column.extend(np.arange(2)), len(column), column.array().tolist()
    (None, None, 5, [0, 1, 2, 0, 1])
    """

    def __init__(self, kind: DTypeLike) -> None:
        self._kind = np.dtype(kind)
        self._recent = bytearray()
        self._file: IO[bytes] | None = None
        self._size = 0

    def __len__(self) -> int:
        return self._size

    def extend(self, values: NDArray[Any]) -> None:
        """Append numbers, shape (n,)."""
        for first in range(0, values.size, PIECE):
            self._recent += values[first : first + PIECE].astype(self._kind, copy=False).tobytes()
            if self._file is not None or self._size > ENOUGH:
                self._move_out()
        self._size += values.size

    def fill(self, value: float, count: int) -> None:
        """Append one number `count` times."""
        for first in range(0, count, PIECE):
            self.extend(np.full(min(PIECE, count - first), value))

    def array(self) -> NDArray[Any]:
        """All numbers, shape (n,); valid until more are appended."""
        if self._file is None:
            return np.frombuffer(bytes(self._recent), self._kind)
        self._move_out()
        self._file.flush()
        return np.memmap(self._file, self._kind, "r")

    def _move_out(self) -> None:
        if self._file is None:
            self._file = tempfile.TemporaryFile()  # noqa: SIM115 -- open as long as the column
            weakref.finalize(self, self._file.close)  # an array that is still in use keeps the mapping
        self._file.write(self._recent)
        self._recent.clear()


def changes(values: NDArray[Any], step: int) -> NDArray[np.int64]:
    """Positions at which an integer does not exceed the one before by `step`, modulo its type.

    >>> changes(np.array([4, 5, 6, 9, 10], np.uint32), 1)
    array([3])
    """
    found = [
        first + np.flatnonzero(np.diff(values[first - 1 : first + PIECE]) != step)
        for first in range(1, values.size, PIECE)
    ]
    return np.concatenate([np.empty(0, np.int64), *found])
