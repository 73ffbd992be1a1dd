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

"""`Hdf5Arrays`: the arrays of an HDF5 file, also of a MATLAB 7.3 file, read one by one."""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...errors import RecordingError
from ..segmentation.decimating_buffer import DecimatingBuffer
from ..table.column_inference import inferred_period
from ..table.read_options import ReadOptions
from .named_arrays import NamedArrays

_SIGNATURE = b"\x89HDF\r\n\x1a\n"
"""First bytes of a file."""

_UNITS = ("units", "Units", "unit", "Unit")
"""Attributes of an array that may state its unit."""

_LARGEST_EXPANSION = 1100
"""Largest number of bytes that one compressed byte can contain."""

LARGEST_CHUNK = 1 << 26
"""Largest number of bytes that are unpacked together from a compressed array."""


def is_hdf5(path: Path) -> bool:
    """True for MATLAB 7.3 (behind its header of 512 bytes) and plain HDF5."""
    with path.open("rb") as file:
        head = file.read(520)
    return _SIGNATURE in (head[:8], head[512:])


class Hdf5Arrays(NamedArrays):
    """Dotted name to array, that of MATLAB oriented as there; texts are arrays of one string.

    An attribute of the file that holds a sample period or a sample rate is called ``attributes.name``.

    Parameters
    ----------
    path : Path
        The file, open while this is used as a context manager.

    Raises
    ------
    RecordingError
        If h5py is not installed, or an array declares more than the file can hold.
    """

    def __init__(self, path: Path) -> None:
        try:
            import h5py
        except ImportError:
            raise RecordingError(
                "is an HDF5 file, for which h5py is needed: pip install h5py; or save it in MATLAB with -v7"
            ) from None
        self._file = h5py.File(path, "r")
        self._rows_last = self._file.userblock_size > 0  # MATLAB stores the transpose after its own header
        self._paths: dict[str, str] = {}  # a name in the file may have dots of its own

        def note(path: str, item: object) -> None:
            if isinstance(item, h5py.Dataset) and not path.startswith("#"):
                self._paths.setdefault(path.replace("/", "."), path)

        try:
            self._file.visititems(note)
            self._attributes = {f"attributes.{name}": np.asarray(value) for name, value in _periods(self._file.attrs)}
        except BaseException:
            self._file.close()
            raise

    def close(self) -> None:
        self._file.close()

    def __iter__(self) -> Iterator[str]:
        return iter((*self._paths, *self._attributes))

    def title(self, name: str) -> str:
        """Name of an array, with its unit in parentheses where an attribute states one."""
        if name in self._attributes:
            return name
        attributes = self._file[self._paths[name]].attrs
        for key in _UNITS:
            if key not in attributes:
                continue
            try:
                unit = np.ravel(attributes[key])[:1]
            except (OSError, TypeError, ValueError):
                continue  # of a type that h5py cannot read
            text = "".join(u.decode("utf-8", "replace") if isinstance(u, bytes) else str(u) for u in unit.tolist())
            if text.strip("[]() "):
                return f"{name} ({text.strip('[]() ')})"
        return name

    def shape(self, name: str) -> tuple[int, ...]:
        if name in self._attributes:
            return ()
        shape = tuple(self._file[self._paths[name]].shape or ())
        return shape[::-1] if self._rows_last else shape

    def samples(self, name: str, column: int | None, options: ReadOptions) -> DecimatingBuffer:
        dataset = self._numbers(name)
        self.check_column(name, column)
        last = dataset.ndim - 1 if self._rows_last else 0
        along = last if column is not None else int(np.argmax(dataset.shape))

        def piece(part: slice) -> NDArray[Any]:
            index: list[int | slice] = [column or 0] * dataset.ndim
            index[along] = part
            return np.asarray(dataset[tuple(index)])

        return self.in_pieces(name, dataset.shape[along], options, piece)

    def __getitem__(self, name: str) -> NDArray[Any]:
        if name in self._attributes:
            return self._attributes[name]
        dataset = self._numbers(name)
        values = np.asarray(dataset[()]).T
        if dataset.attrs.get("MATLAB_class") == b"char":
            return np.array("".join(map(chr, values.ravel(order="F").tolist())))
        return values

    def _numbers(self, name: str) -> Any:
        """The dataset of a name, its size checked."""
        if name in self._attributes:
            raise RecordingError(f"{name}: got one number, expected an array")
        dataset = self._file[self._paths[name]]
        with warnings.catch_warnings():
            warnings.simplefilter("error")  # a type that numpy cannot represent is not supported
            kind = dataset.dtype
        if kind.kind not in "fiub":
            raise RecordingError(f"{name}: got {kind}, expected numbers or text")
        if dataset.external or dataset.is_virtual:
            raise RecordingError(f"{name}: its numbers are in other files, expected a file that contains them")
        if dataset.chunks is not None and math.prod(dataset.chunks) * kind.itemsize > LARGEST_CHUNK:
            raise RecordingError(
                f"{name}: got chunks of {dataset.chunks}, expected at most {LARGEST_CHUNK} bytes in one"
            )
        size = dataset.size * dataset.dtype.itemsize
        if size > _LARGEST_EXPANSION * (dataset.id.get_storage_size() + 1000):
            raise RecordingError(f"{name}: declares {size} bytes, more than the file can hold")
        return dataset


def _periods(attributes: Mapping[str, Any]) -> Iterator[tuple[str, float]]:
    """Attributes that are called like a sample period or a sample rate, and hold one positive number."""
    for name in attributes:
        if inferred_period([name]) is None:
            continue
        with suppress(OSError, TypeError, ValueError):  # of a type that h5py or numpy cannot read
            value = np.asarray(attributes[name])
            if value.size == 1 and value.dtype.kind in "fiu" and 0.0 < (number := float(value.reshape(()))) < math.inf:
                yield name, number
