"""MATLAB files: version 5 to 7.2 read and written through scipy, 7.3 (HDF5) read through h5py."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import RecordingError
from ..record import Experiment, Notice, Record, Samples
from .damage import naming
from .hdf5_variables import Hdf5Variables, is_hdf5
from .layout import CHANNELS, LABELS, Layout
from .mat5_sizes import check_sizes
from .table import table_records

_PLACE = re.compile(r"(?P<name>[^\[\]]+?)(\[(?P<column>[1-9]\d{0,8})\])?")
_STRUCT = "phase_"

Variables = Mapping[str, NDArray[Any]]


class Mat:
    """One struct per record, ``phase_01``, ``phase_02``, …, or the variables of a foreign file.

    Fields and variables are called as the channels (`voltage` [V], `displacement` [m], `time` [s], …) and labels
    (`phase`, `sample_period`, `continues`, …). `Layout.columns` names others: ``"u"``, ``"data.position"`` for a field
    of a struct, ``"y[2]"`` for a column of a matrix, counted from 1 as in MATLAB.
    """

    def recognises(self, path: Path) -> bool:
        """True for the ending .mat."""
        return path.is_file() and path.suffix.lower() == ".mat"

    def read(self, path: Path, layout: Layout) -> Experiment:
        """The structs in order of their numbers, or the variables as one record."""
        with naming(path, "a MAT file"), _opened(path, layout) as variables:
            structs = sorted({name.partition(".")[0] for name in variables if re.match(_STRUCT + r"\d+\.", name)})
            records: list[Record] = []
            notices: list[Notice] = []
            for prefix in [""] if layout.columns or not structs else [f"{struct}." for struct in structs]:
                parts, told = _records(variables, prefix, layout, records)
                records += parts
                notices += told
            return Experiment(tuple(records), str(path), tuple(notices))

    def write(self, experiment: Experiment, path: Path) -> None:
        """Write one struct per record, version 5.

        Raises
        ------
        RecordingError
            If the file exists or cannot be written.
        """
        from scipy import io  # slow to import, and only needed here

        structs = {}
        for number, record in enumerate(experiment, 1):
            fields: dict[str, Any] = {"voltage": record.voltage, "displacement": record.displacement}
            for name in (*CHANNELS[3:], *LABELS):
                value = getattr(record, name, None)
                if value is not None:
                    fields[name] = value
            structs[f"{_STRUCT}{number:02d}"] = fields
        with naming(path, "a file that can be written"):
            if path.exists():
                raise RecordingError("exists already; choose another name")
            io.savemat(path, structs, oned_as="column")


def _opened(path: Path, layout: Layout) -> AbstractContextManager[Variables]:
    """Dotted name to array, of every variable and field that may matter."""
    if is_hdf5(path):
        return Hdf5Variables(path)
    from scipy import io  # slow to import, and only needed here

    check_sizes(path)
    named = {re.split(r"[.\[]", str(place))[0] for place in layout.columns.values()}
    wanted = [
        name
        for name, _, _ in io.whosmat(path)
        if name in named or name in (*CHANNELS, *LABELS) or re.fullmatch(_STRUCT + r"\d+", name)
    ]
    if not wanted:
        held = ", ".join(name for name, _, _ in io.whosmat(path)[:30]) or "no variables"
        raise RecordingError(f"got {held}, expected voltage and displacement; name them by columns")
    flat: dict[str, NDArray[Any]] = {}
    _flatten("", io.loadmat(path, simplify_cells=True, variable_names=wanted), flat)
    return nullcontext(flat)


def _flatten(prefix: str, content: Mapping[str, Any], flat: dict[str, NDArray[Any]]) -> None:
    for name, value in content.items():
        if isinstance(value, dict):
            _flatten(f"{prefix}{name}.", value, flat)
        elif not name.startswith("__"):
            flat[prefix + name] = np.asarray(value)


def _records(
    variables: Variables, prefix: str, layout: Layout, before: Sequence[Record]
) -> tuple[list[Record], list[Notice]]:
    columns: dict[str, Samples] = {}
    for channel in CHANNELS:
        place = str(layout.columns.get(channel, prefix + channel))
        if channel in layout.columns or place in variables:
            columns[channel] = layout.in_si(channel, _channel(variables, place))
        elif channel in ("voltage", "displacement"):
            raise RecordingError(f"got {_listed(variables)}, expected {place}; name it by columns")
    sizes = {name: values.size for name, values in columns.items()}
    if len(set(sizes.values())) > 1:
        raise RecordingError(f"got channels of {sizes} samples, expected equal lengths")
    labels = {}
    for label in LABELS:
        place = str(layout.columns.get(label, prefix + label))
        if place in variables:
            labels[label] = _label(variables[place], place)
    return table_records(columns, [(0, labels)], layout, before)


def _channel(variables: Variables, place: str) -> Samples:
    match = _PLACE.fullmatch(place)
    name, column = (match["name"], match["column"]) if match else (place, None)
    if name not in variables:
        raise RecordingError(f"got {_listed(variables)}, expected {place}")
    values = variables[name]
    if values.dtype.kind not in "fiub":
        raise RecordingError(f"{place}: got {values.dtype}, expected real numbers")
    if column is not None:
        if values.ndim != 2 or int(column) > values.shape[1]:
            raise RecordingError(f"{place}: got shape {values.shape}, expected a matrix with that column")
        return values[:, int(column) - 1].astype(np.float64)
    if values.size != max(values.shape, default=1):
        raise RecordingError(f"{place}: got shape {values.shape}, expected a vector; choose a column as {place}[1]")
    return values.astype(np.float64).ravel()


def _label(value: NDArray[Any], place: str) -> str:
    if value.size != 1 or value.dtype.kind not in "Ufiub":
        raise RecordingError(f"{place}: got {value.dtype} of shape {value.shape}, expected one text or number")
    item = value.reshape(()).item()
    return str(int(item)) if isinstance(item, bool) else str(item)


def _listed(variables: Variables) -> str:
    return "the variables " + ", ".join(list(variables)[:30])
