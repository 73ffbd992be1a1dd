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

"""`NpzMembers`: the arrays of an .npz archive, long ones read in pieces."""

from __future__ import annotations

import math
import zipfile
from collections.abc import Iterator
from typing import IO, Any

import numpy as np

from ...errors import RecordingError
from ...record import Samples
from ..segmentation.decimating_buffer import PIECE, DecimatingBuffer

_MAGIC_READERS = {(1, 0): np.lib.format.read_array_header_1_0, (2, 0): np.lib.format.read_array_header_2_0}
"""Readers of the header by version of the format."""
_LARGEST_EXPANSION = 100
"""Largest size of the members over that of the file."""
_SMALL = 1 << 26
"""Bytes that are always accepted."""


class NpzMembers:
    """Arrays of a zip archive. An array that declares more than the file can contain is refused.

    Parameters
    ----------
    archive : ZipFile
        Open while this is used.
    file_size : int
        Bytes of the archive.
    """

    def __init__(self, archive: zipfile.ZipFile, file_size: int) -> None:
        self._archive = archive
        self._members = {m.filename.removesuffix(".npy"): m for m in archive.infolist()}
        self._budget = max(_SMALL, _LARGEST_EXPANSION * file_size)

    def __contains__(self, name: object) -> bool:
        return name in self._members

    def __iter__(self) -> Iterator[str]:
        return iter(self._members)

    def size(self, name: str) -> int:
        """Number of samples of an array, from its header."""
        with self._archive.open(self._member(name)) as stream:
            shape, _ = self._header(name, stream)
        return math.prod(shape)

    def samples(self, name: str, part: slice, average: int) -> Samples:
        """A part of a one-dimensional array, averaged while it is read in pieces.

        Raises
        ------
        RecordingError
            If it is not an array of real numbers, or the part is empty.
        """
        with self._archive.open(self._member(name)) as stream:
            shape, dtype = self._header(name, stream)
            self._check(name, dtype, shape)
            if len(shape) != 1:
                raise RecordingError(f"{name}: got shape {shape}, expected one dimension")
            buffer = DecimatingBuffer(1, part.start, min(part.stop, shape[0]), average)
            for first in range(0, buffer.stop or 0, PIECE):
                raw = stream.read(min(PIECE, shape[0] - first) * dtype.itemsize)
                buffer.add(np.frombuffer(raw, dtype).astype(np.float64)[:, None])
        if buffer.rows < (buffer.stop or 0):
            raise RecordingError(f"{name}: got {buffer.rows} samples, expected {shape[0]}")
        return buffer.column(0)

    def number(self, name: str) -> float:
        """The number in an array of one element."""
        value = self._array(name)
        if value.size != 1:
            raise RecordingError(f"{name}: got shape {value.shape}, expected one number")
        self._check(name, value.dtype, value.shape)
        return float(value.reshape(()))

    def text(self, name: str, default: str) -> str:
        """The text in an array of one element, or the default where there is no such array."""
        if name not in self:
            return default
        value = self._array(name)
        if value.size != 1 or value.dtype.kind not in "US":
            raise RecordingError(f"{name}: got {value.dtype} of shape {value.shape}, expected one text")
        word = value.reshape(()).item()
        return word.decode("utf-8") if isinstance(word, bytes) else str(word)

    def _member(self, name: str) -> zipfile.ZipInfo:
        member = self._members.get(name)
        if member is None:
            held = ", ".join(sorted(self._members)[:20]) or "nothing"
            raise RecordingError(
                f"holds {held}, expected the key '{name}'; name it by `columns`, or give `sample_period`"
            )
        return member

    def _header(self, name: str, stream: IO[bytes]) -> tuple[tuple[int, ...], np.dtype[Any]]:
        """Shape and type of an array, its size checked; the stream then stands at its first item."""
        version = np.lib.format.read_magic(stream)
        if version not in _MAGIC_READERS:
            raise RecordingError(f"{name}: got npy version {version}, expected 1.0 or 2.0")
        shape, _, dtype = _MAGIC_READERS[version](stream)
        if dtype.hasobject:
            raise RecordingError(f"{name}: got pickled objects, expected numbers or text")
        if not all(type(n) is int and n >= 0 for n in shape):
            raise RecordingError(f"{name}: got shape {shape}, expected whole numbers of samples")
        declared = math.prod(shape) * dtype.itemsize
        if declared > self._member(name).file_size or declared > self._budget:
            raise RecordingError(f"{name}: declares {declared} bytes, more than the file can hold")
        return shape, dtype

    def _array(self, name: str) -> np.ndarray[Any, Any]:
        member = self._member(name)
        with self._archive.open(member) as stream:
            self._header(name, stream)
        with self._archive.open(member) as stream:
            return np.asarray(np.lib.format.read_array(stream, allow_pickle=False))

    @staticmethod
    def _check(name: str, dtype: np.dtype[Any], shape: tuple[int, ...]) -> None:
        if dtype.kind not in "fiub":
            raise RecordingError(f"{name}: got {dtype} of shape {shape}, expected real numbers")
