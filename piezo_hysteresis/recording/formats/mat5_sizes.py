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

"""Checks the lengths in a MATLAB 5 file before memory is allocated."""

from __future__ import annotations

import math
import struct
import zlib
from pathlib import Path
from typing import BinaryIO

from ...errors import RecordingError

HEADER = 128
"""Bytes of the header of a MAT 5 file."""
MATRIX, COMPRESSED = 14, 15
"""Kinds of MAT 5 elements: matrix, compressed element."""
ORDERS = {b"IM": "<", b"MI": ">"}
"""Last bytes of the header to the byte order of the file."""

_INT32 = 5
"""Kind of a MAT 5 element: 32 bit integers."""
_LARGEST_EXPANSION = 1100
"""Largest size of an element over that of its compressed form."""
_DEEPEST = 20
"""Largest depth of nested structures."""


def check_sizes(path: Path) -> None:
    """Walk through the elements of a file.

    Raises
    ------
    RecordingError
        If an element declares more bytes, or an array more items, than the file can contain.
    """
    size = path.stat().st_size
    with path.open("rb") as file:
        order = ORDERS.get(file.read(HEADER)[126:])
        if order is None:
            raise RecordingError("got other first bytes than those of a MATLAB 5 file")
        while file.tell() + 8 <= size:
            kind, length = struct.unpack(order + "II", file.read(8))
            after = file.tell() + length
            if after > size:
                raise RecordingError(f"a variable declares {length} bytes, {size - file.tell()} are left")
            if kind == COMPRESSED:
                inflated = Inflated(file, length)
                _Elements(inflated, order).check(_LARGEST_EXPANSION * length, 0)
            elif kind == MATRIX:
                file.seek(-8, 1)
                _Elements(file, order).check(length + 8, 0)
            file.seek(after)


class Inflated:
    """Bytes of one compressed variable, uncompressed in small pieces."""

    def __init__(self, file: BinaryIO, length: int) -> None:
        self._file, self._left = file, length
        self._zlib = zlib.decompressobj()

    def read(self, count: int) -> bytes:
        parts = []
        while count > 0:
            waiting = self._zlib.unconsumed_tail
            if not waiting and self._left:
                waiting = self._file.read(min(self._left, 1 << 16))
                self._left -= len(waiting)
            part = self._zlib.decompress(waiting, count)
            if not part and not self._left and not self._zlib.unconsumed_tail:
                break
            parts.append(part)
            count -= len(part)
        return b"".join(parts)


class _Elements:
    """Elements in a stream: tag, bytes, padding to eight."""

    def __init__(self, stream: BinaryIO | Inflated, order: str) -> None:
        self._stream, self._order = stream, order

    def check(self, room: int, depth: int) -> int:
        """Check one element of at most `room` bytes, and return its length."""
        tag = self._stream.read(8)
        if len(tag) < 8 or room < 8:
            raise RecordingError("a variable ends within its own description")
        kind, length = struct.unpack(self._order + "II", tag)
        if kind >> 16:  # small element: length and data are inside the tag
            return 8
        padded = length + -length % 8
        if length > room - 8 or depth > _DEEPEST:
            raise RecordingError(f"an element declares {length} bytes, {room - 8} are left")
        if kind == MATRIX and length:
            self._check_matrix(length, depth)
        else:
            self._skip(padded)
        return 8 + padded

    def _check_matrix(self, length: int, depth: int) -> None:
        taken = self.check(length, depth)  # flags
        tag = self._stream.read(8)
        kind, count = struct.unpack(self._order + "II", tag) if len(tag) == 8 else (0, 0)
        if kind != _INT32 or count > length - taken - 8:
            raise RecordingError("a variable has no dimensions")
        dimensions = struct.unpack(f"{self._order}{count // 4}i", self._stream.read(count // 4 * 4))
        self._skip(count + -count % 8 - count // 4 * 4)
        taken += 8 + count + -count % 8
        if math.prod(dimensions) > length or min(dimensions, default=0) < 0:
            raise RecordingError(f"a variable declares {' x '.join(map(str, dimensions))} items in {length} bytes")
        while taken + 8 <= length:
            taken += self.check(length - taken, depth + 1)

    def _skip(self, count: int) -> None:
        while count > 0:
            passed = len(self._stream.read(min(count, 1 << 16)))
            if not passed:
                return
            count -= passed
