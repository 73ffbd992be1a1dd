"""`Hdf5Variables`: the variables of a MATLAB 7.3 file, read one by one."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import RecordingError
from .intake import Intake
from .layout import Layout

_SIGNATURE = b"\x89HDF\r\n\x1a\n"
_LARGEST_EXPANSION = 1100
_ROWS = 1 << 18


def is_hdf5(path: Path) -> bool:
    """True for MATLAB 7.3 (behind its header of 512 bytes) and plain HDF5."""
    with path.open("rb") as file:
        head = file.read(520)
    return _SIGNATURE in (head[:8], head[512:])


class Hdf5Variables(Mapping[str, NDArray[Any]]):
    """Dotted name to array, oriented as in MATLAB; texts are arrays of one string.

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
                "is a MATLAB 7.3 file, for which h5py is needed: pip install h5py, or save it in MATLAB with -v7"
            ) from None
        self._file = h5py.File(path, "r")
        self._names: list[str] = []
        try:
            self._file.visititems(
                lambda name, item: self._names.append(name) if isinstance(item, h5py.Dataset) else None
            )
        except BaseException:
            self._file.close()
            raise

    def __enter__(self) -> Hdf5Variables:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._file.close()

    def __iter__(self) -> Iterator[str]:
        return (name.replace("/", ".") for name in self._names if not name.startswith("#"))

    def __contains__(self, name: object) -> bool:
        return name in set(self)  # a mapping would read it to see

    def __len__(self) -> int:
        return sum(1 for _ in self)

    def samples(self, name: str, column: int | None, layout: Layout) -> Intake:
        """The one column of a vector, or a column of a matrix; only the rows that a layout keeps are read.

        Parameters
        ----------
        name : str
            Dotted name.
        column : int or None
            Column in MATLAB, counted from 0.
        layout : Layout
            Its `rows`, where they count from the beginning, and its `average` apply.

        Raises
        ------
        RecordingError
            If there is no such column, or several where none is named.
        """
        dataset = self._numbers(name)
        shape = tuple(dataset.shape[::-1])  # as in MATLAB
        if column is None and dataset.size != max(shape, default=1):
            raise RecordingError(f"{name}: got shape {shape}, expected a vector; choose a column as {name}[1]")
        if column is not None and (len(shape) != 2 or column >= shape[1]):
            raise RecordingError(f"{name}: got shape {shape}, expected a matrix with that column")
        along = dataset.ndim - 1 if column is not None else int(np.argmax(dataset.shape))
        intake = Intake.of(1, layout)
        for first in range(0, dataset.shape[along], _ROWS):
            index: list[int | slice] = [column or 0] * dataset.ndim
            index[along] = slice(first, first + _ROWS)
            skipped = first + _ROWS <= intake.start
            intake.add(np.empty((_ROWS, 1)) if skipped else np.asarray(dataset[tuple(index)], np.float64)[:, None])
            if intake.is_full:
                break
        return intake

    def __getitem__(self, name: str) -> NDArray[Any]:
        dataset = self._numbers(name)
        values = np.asarray(dataset[()]).T
        if dataset.attrs.get("MATLAB_class") == b"char":
            return np.array("".join(map(chr, values.ravel(order="F").tolist())))
        return values

    def _numbers(self, name: str) -> Any:
        """The dataset of a name, its size checked."""
        if name not in set(self):
            raise KeyError(name)
        dataset = self._file[name.replace(".", "/")]
        if dataset.dtype.kind not in "fiub":
            raise RecordingError(f"{name}: got {dataset.dtype}, expected numbers or text")
        size = dataset.size * dataset.dtype.itemsize
        if size > _LARGEST_EXPANSION * (dataset.id.get_storage_size() + 1000):
            raise RecordingError(f"{name}: declares {size} bytes, more than the file can hold")
        return dataset
