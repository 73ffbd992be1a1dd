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
from ..record import Experiment, Notice, Record
from .damage import naming
from .guess import guess_notice, guessed, guessed_period, unit_in
from .hdf5_variables import Hdf5Variables, is_hdf5
from .intake import Intake, averaged_notice
from .layout import CHANNELS, LABELS, Layout
from .mat5_sizes import check_sizes
from .table import table_records

_PLACE = re.compile(r"(?P<name>[^\[\]]+?)(\[(?P<column>[1-9]\d{0,8})\])?")
_STRUCT = "phase_"
_ROWS = 1 << 20

Variables = Mapping[str, NDArray[Any]]


class Mat:
    """One struct per record, ``phase_01``, ``phase_02``, …, or the variables of a foreign file.

    Fields and variables are called as the channels (`voltage` [V], `displacement` [m], `time` [s], …) and labels
    (`phase`, `sample_period`, `continues`, …). `Layout.columns` names others: ``"u"``, ``"data.position"`` for a field
    of a struct, ``"y[2]"`` for a column of a matrix, counted from 1 as in MATLAB.
    """

    averages = True

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
    held = [name for name, _, _ in io.whosmat(path)]
    wanted = [name for name in held if name in named or name in (*CHANNELS, *LABELS) or guessed_period([name])]
    wanted += [name for name in held if re.fullmatch(_STRUCT + r"\d+", name)]
    found = {channel for channel in CHANNELS if channel in layout.columns or channel in held}
    if not {"voltage", "displacement"} <= found and not any(name.startswith(_STRUCT) for name in wanted):
        wanted = held  # of other software: whatever it calls them
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
    given = {c: str(layout.columns.get(c, prefix + c)) for c in (*CHANNELS, *LABELS)}
    places = {c: place for c, place in given.items() if c in layout.columns or place in variables}
    labels = {name: _label(variables[places[name]], places[name]) for name in LABELS if name in places}
    if layout.sample_period is None and "sample_period" not in places and (found := guessed_period(variables)):
        value = float(_label(variables[found[0]], found[0]))
        labels["sample_period"] = repr(1.0 / value if found[1] else value)
    timed = layout.sample_period is not None or "sample_period" in labels
    names = [name for name in variables if name not in places.values()]
    wanted = [c for c in ("time", "voltage", "displacement") if c not in places and not (c == "time" and timed)]
    guess = {c: names[at] for c, at in guessed([n.rpartition(".")[2] for n in names], (), wanted).items()}
    places |= guess
    for channel in ("voltage", "displacement"):
        if channel not in places:
            raise RecordingError(f"got {_listed(variables)}, expected {given[channel]}; name it by columns")
    units = {c: unit_in(place, c) for c, place in places.items() if c in CHANNELS}
    intakes = {c: _channel(variables, places[c], layout) for c in CHANNELS if c in places}
    columns = {c: layout.in_si(c, intake.column(0), units[c]) for c, intake in intakes.items()}
    sizes = {name: values.size for name, values in columns.items()}
    if len(set(sizes.values())) > 1:
        raise RecordingError(f"got channels of {sizes} samples, expected equal lengths")
    average = intakes["voltage"].factor
    rest = layout.after_reading(average)
    records, notices = table_records(columns, [(0, labels)], rest, before, truncated=layout.passes_over)
    if layout.average is None and average > 1:
        notices.append(averaged_notice(average, records[0].sample_period, labels.get("phase", "")))
    return records, [*notices, *guess_notice(guess, units)]


def _channel(variables: Variables, place: str, layout: Layout) -> Intake:
    match = _PLACE.fullmatch(place)
    name, number = (match["name"], match["column"]) if match else (place, None)
    if name not in variables:
        raise RecordingError(f"got {_listed(variables)}, expected {place}")
    column = None if number is None else int(number) - 1
    if isinstance(variables, Hdf5Variables):
        return variables.samples(name, column, layout)
    values = variables[name]
    if values.dtype.kind not in "fiub":
        raise RecordingError(f"{place}: got {values.dtype}, expected real numbers")
    if column is not None and (values.ndim != 2 or column >= values.shape[1]):
        raise RecordingError(f"{place}: got shape {values.shape}, expected a matrix with that column")
    if column is None and values.size != max(values.shape, default=1):
        raise RecordingError(f"{place}: got shape {values.shape}, expected a vector; choose a column as {place}[1]")
    intake = Intake.of(1, layout)
    whole = values.ravel() if column is None else values[:, column]
    for first in range(0, whole.size, _ROWS):
        intake.add(whole[first : first + _ROWS].astype(np.float64, copy=False)[:, None])
    return intake


def _label(value: NDArray[Any], place: str) -> str:
    if value.size != 1 or value.dtype.kind not in "Ufiub":
        raise RecordingError(f"{place}: got {value.dtype} of shape {value.shape}, expected one text or number")
    item = value.reshape(()).item()
    return str(int(item)) if isinstance(item, bool) else str(item)


def _listed(variables: Variables) -> str:
    return "the variables " + ", ".join(list(variables)[:30])
