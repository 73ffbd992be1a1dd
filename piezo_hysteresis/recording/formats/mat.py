"""MATLAB files: version 5 to 7.2 read and written through scipy, 7.3 (HDF5) read through h5py."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from ...errors import RecordingError
from ...record import Experiment, Notice, Record
from ..checks.error_context import naming
from ..segmentation.decimating_buffer import DecimatingBuffer, averaged_notice
from ..table.column_inference import inference_notice, inferred_columns, inferred_period, unit_in
from ..table.read_options import CHANNELS, LABELS, ReadOptions, is_channel
from ..table.table import table_records
from .hdf5_variables import Hdf5Variables, is_hdf5
from .mat5_variables import Mat5Variables
from .mat_variables import MatVariables

_PLACE = re.compile(r"(?P<name>[^\[\]]+?)(\[(?P<column>[1-9]\d{0,8})\])?")
"""Where a channel stands: ``name[column]``."""
_STRUCT = "phase_"
"""Beginning of the names of the structures that hold phases."""


class Mat:
    """One struct per record, ``phase_01``, ``phase_02``, …, or the variables of a foreign file.

    Fields and variables are called as the channels (`voltage` [V], `displacement` [m], `time` [s], …) and labels
    (`phase`, `sample_period`, `continues`, …). `ReadOptions.columns` names others: ``"u"``,
    ``"data.position"`` for a field of a struct, ``"y[2]"`` for a column of a matrix, counted from 1 as in MATLAB.
    """

    def recognises(self, path: Path) -> bool:
        """True for the ending .mat."""
        return path.is_file() and path.suffix.lower() == ".mat"

    def read(self, path: Path, layout: ReadOptions) -> Experiment:
        """The structs in order of their numbers, or the variables as one record."""
        with naming(path, "a MAT file"), (Hdf5Variables if is_hdf5(path) else Mat5Variables)(path) as variables:
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
            fields |= record.channels
            for name in LABELS:
                value = getattr(record, name, None)
                if value is not None:
                    fields[name] = value
            structs[f"{_STRUCT}{number:02d}"] = fields
        with naming(path, "a file that can be written"):
            if path.exists():
                raise RecordingError("exists already; choose another name")
            io.savemat(path, structs, oned_as="column")


def _records(
    variables: MatVariables, prefix: str, layout: ReadOptions, before: Sequence[Record]
) -> tuple[list[Record], list[Notice]]:
    fields = [name.removeprefix(prefix) for name in variables if name.startswith(prefix)]
    others = [name for name in (*fields, *layout.columns) if is_channel(name)]
    given = {c: str(layout.columns.get(c, prefix + c)) for c in (*CHANNELS, *others, *LABELS)}
    places = {c: place for c, place in given.items() if c in layout.columns or place in variables}
    labels = {name: _label(variables[places[name]], places[name]) for name in LABELS if name in places}
    if layout.sample_period is None and "sample_period" not in places and (found := inferred_period(variables)):
        value = float(_label(variables[found[0]], found[0]))
        labels["sample_period"] = repr(1.0 / value if found[1] else value)
    timed = layout.sample_period is not None or "sample_period" in labels
    names = [name for name in variables if name not in places.values()]
    wanted = [c for c in ("time", "voltage", "displacement") if c not in places and not (c == "time" and timed)]
    guess = {c: names[at] for c, at in inferred_columns([n.rpartition(".")[2] for n in names], (), wanted).items()}
    places |= guess
    for channel in ("voltage", "displacement"):
        if channel not in places:
            raise RecordingError(f"got {_listed(variables)}, expected {given[channel]}; name it by `columns`")
    units = {c: unit_in(place, c) for c, place in places.items() if is_channel(c)}
    intakes = {c: _channel(variables, places[c], layout) for c in units}
    columns = {c: layout.in_si(c, intake.column(0), units[c]) for c, intake in intakes.items()}
    sizes = {name: values.size for name, values in columns.items()}
    if len(set(sizes.values())) > 1:
        raise RecordingError(f"got channels of {sizes} samples, expected equal lengths")
    average = intakes["voltage"].factor
    rest = layout.after_reading(average)
    records, notices = table_records(columns, [(0, labels)], rest, before, truncated=layout.passes_over)
    if layout.average is None and average > 1:
        notices.append(averaged_notice(average, records[0].sample_period, labels.get("phase", "")))
    return records, [*notices, *inference_notice(guess, units)]


def _channel(variables: MatVariables, place: str, layout: ReadOptions) -> DecimatingBuffer:
    match = _PLACE.fullmatch(place)
    name, number = (match["name"], match["column"]) if match else (place, None)
    if name not in variables:
        raise RecordingError(f"got {_listed(variables)}, expected {place}")
    column = None if number is None else int(number) - 1
    return variables.samples(name, column, layout)


def _label(value: NDArray[Any], place: str) -> str:
    if value.size != 1 or value.dtype.kind not in "Ufiub":
        raise RecordingError(f"{place}: got {value.dtype} of shape {value.shape}, expected one text or number")
    item = value.reshape(()).item()
    return str(int(item)) if isinstance(item, bool) else str(item)


def _listed(variables: MatVariables) -> str:
    return "the variables " + ", ".join(list(variables)[:30])
