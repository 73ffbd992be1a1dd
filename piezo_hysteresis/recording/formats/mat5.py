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

"""`Mat5Arrays`: the variables of a MATLAB file of version 5 to 7.2, long ones read in pieces."""

from __future__ import annotations

import math
import struct
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from ...errors import RecordingError
from ..segmentation.decimating_buffer import PIECE, DecimatingBuffer
from ..table.read_options import ReadOptions
from .mat5_sizes import COMPRESSED, HEADER, MATRIX, ORDERS, Inflated, check_sizes
from .named_arrays import NamedArrays

_LONG = 1 << 20
"""Number of elements from which a matrix is read in pieces."""
_REAL = range(6, 16)
"""Classes of numeric MAT 5 arrays."""
_COMPLEX = 0x800
"""Flag of a complex MAT 5 array."""
_TYPES = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}
"""Format of every numeric kind of MAT 5 element."""


@dataclass(frozen=True, slots=True)
class _Matrix:
    """Position of the numbers of a matrix, one column after the other."""

    position: int
    """Position of its element in the file."""
    shape: tuple[int, ...]
    offset: int
    """Offset of its first number in the uncompressed element."""
    kind: np.dtype[Any]


class Mat5Arrays(NamedArrays):
    """Dotted name to array of every variable and field; one variable is in memory at a time.

    Parameters
    ----------
    path : Path
        The file.

    Raises
    ------
    RecordingError
        If an array declares more than the file can hold.
    """

    def __init__(self, path: Path) -> None:
        from scipy import io  # slow to import, and only needed here

        check_sizes(path)
        self._path = path
        self._load = io.loadmat
        self._classes = {name: kind for name, _, kind in io.whosmat(path)}
        self._long = _long_matrices(path)
        self._loaded: tuple[str, dict[str, NDArray[Any]]] = ("", {})
        self._fields: dict[str, list[str]] = {}

    def close(self) -> None:
        self._loaded = ("", {})

    def __iter__(self) -> Iterator[str]:
        for name, kind in self._classes.items():
            if kind != "struct":
                yield name
                continue
            if name not in self._fields:
                self._fields[name] = list(self._variable(name))
            yield from self._fields[name]

    def __getitem__(self, name: str) -> NDArray[Any]:
        top = name.partition(".")[0]
        if top not in self._classes:
            raise KeyError(name)
        return self._variable(top)[name]

    def shape(self, name: str) -> tuple[int, ...]:
        return self._long[name].shape if name in self._long else self[name].shape

    def samples(self, name: str, column: int | None, options: ReadOptions) -> DecimatingBuffer:
        self.check_column(name, column)
        if (matrix := self._long.get(name)) is not None:
            buffer = DecimatingBuffer.of(1, options)
            count = math.prod(matrix.shape) if column is None else matrix.shape[0]
            _read(self._path, matrix, (column or 0) * count, count, buffer)
            return buffer
        values = self[name].ravel() if column is None else self[name][:, column]
        return self.in_pieces(name, values.size, options, lambda part: np.asarray(values[part]))

    def _variable(self, top: str) -> dict[str, NDArray[Any]]:
        """Everything in one variable, by dotted names."""
        if self._loaded[0] != top:
            self._loaded = ("", {})  # before the next one is read
            flat: dict[str, NDArray[Any]] = {}
            _flatten("", self._load(self._path, simplify_cells=True, variable_names=[top]), flat)
            self._loaded = (top, flat)
        return self._loaded[1]


def _flatten(prefix: str, content: Mapping[str, Any], flat: dict[str, NDArray[Any]]) -> None:
    for name, value in content.items():
        signals = value if isinstance(value, list) else [value]
        if signals and all(isinstance(signal, dict) and {"Name", "Data"} <= signal.keys() for signal in signals):
            _add_signals(f"{prefix}{name}.", signals, flat)
        elif isinstance(value, dict):
            _flatten(f"{prefix}{name}.", value, flat)
        elif not name.startswith("__"):
            flat[prefix + name] = np.asarray(value)


def _add_signals(prefix: str, signals: Sequence[Mapping[str, Any]], flat: dict[str, NDArray[Any]]) -> None:
    """Signals of a dSPACE capture by their names, with their units. The signal without a name is the time."""
    for signal in signals:
        path = [part.strip('" ') for part in (_text(signal["Name"]) or "time").split("/")]
        unit = _text(signal.get("Unit", "")).strip("[] ")
        end = f" ({unit})" if unit and unit.isascii() else ""
        title, count = path[-1].translate(_BRACKETS), 1
        while (name := f"{prefix}{title}{f' {count}' if count > 1 else ''}{end}") in flat:
            count += 1  # signals of different blocks may have the same name
        flat[name] = np.asarray(signal["Data"])


def _text(value: Any) -> str:
    """A text; an empty array stands for an empty text."""
    return value if isinstance(value, str) else ""


_BRACKETS = str.maketrans("[]", "()")
"""Replacement for brackets, which denote the column of a matrix."""


def _long_matrices(path: Path) -> dict[str, _Matrix]:
    """Long real matrices by name, in a file whose sizes have been checked."""
    found = {}
    size = path.stat().st_size
    with path.open("rb") as file:
        order = ORDERS[file.read(HEADER)[126:]]
        position = HEADER
        while position + 8 <= size:
            file.seek(position)
            kind, length = struct.unpack(order + "II", file.read(8))
            if kind in (MATRIX, COMPRESSED):
                name, matrix = _described(_opened(file, position, order), position, order)
                if matrix is not None:
                    found[name] = matrix
            position += 8 + length
    return found


def _opened(file: BinaryIO, position: int, order: str) -> BinaryIO | Inflated:
    """The uncompressed element at a position of the file, beginning with its tag."""
    file.seek(position)
    kind, length = struct.unpack(order + "II", file.read(8))
    if kind == COMPRESSED:
        return Inflated(file, length)
    file.seek(position)
    return file


def _described(stream: BinaryIO | Inflated, position: int, order: str) -> tuple[str, _Matrix | None]:
    """Name of a variable, and the position of its numbers if it is a long matrix of real numbers."""
    head = stream.read(8 + 16)
    if len(head) < 24:
        return "", None
    flags = struct.unpack(order + "I", head[16:20])[0]
    taken = len(head)
    parts = []
    for _ in range(2):
        part, length = _small_or_long(stream, order)
        parts.append(part)
        taken += length
    name = parts[1].decode("latin-1")
    shape = struct.unpack(f"{order}{len(parts[0]) // 4}i", parts[0])
    tag = stream.read(8)
    kind = struct.unpack(order + "I", tag[:4])[0] if len(tag) == 8 else 0
    if flags & 0xFF not in _REAL or flags & _COMPLEX or kind not in _TYPES or math.prod(shape) < _LONG:
        return name, None
    return name, _Matrix(position, shape, taken + 8, np.dtype(order + _TYPES[kind]))


def _small_or_long(stream: BinaryIO | Inflated, order: str) -> tuple[bytes, int]:
    """Bytes of an element, and its length with tag and padding."""
    tag = stream.read(8)
    if len(tag) < 8:
        return b"", len(tag)
    kind, length = struct.unpack(order + "II", tag)
    if kind >> 16:
        return tag[4 : 4 + (kind >> 16)], 8
    padded = length + -length % 8
    return stream.read(min(padded, 1 << 16))[:length], 8 + padded


def _read(path: Path, matrix: _Matrix, first: int, count: int, buffer: DecimatingBuffer) -> None:
    """Read `count` numbers, beginning with number `first`."""
    with path.open("rb") as file:
        order = ORDERS[file.read(HEADER)[126:]]
        stream = _opened(file, matrix.position, order)
        ahead = matrix.offset + first * matrix.kind.itemsize
        while ahead > 0:
            ahead -= len(stream.read(min(ahead, PIECE))) or ahead
        while count > 0 and not buffer.is_full:
            raw = stream.read(min(count, PIECE) * matrix.kind.itemsize)
            values = np.frombuffer(raw[: len(raw) // matrix.kind.itemsize * matrix.kind.itemsize], matrix.kind)
            if not values.size:
                raise RecordingError(f"a variable ends {count} numbers early")
            buffer.add(values.astype(np.float64)[:, None])
            count -= values.size
