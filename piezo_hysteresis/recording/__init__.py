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

"""Reads and writes experiments without ROS: rosbag2, NPZ, CSV, MAT and GCS arrays.

>>> experiment = read("measured.csv", columns={"voltage": 1, "displacement": 5},
...                   units={"displacement": "um"}, sample_period=5e-3)          # doctest: +SKIP

`read` repairs nothing silently. It lists its findings in `Experiment.notices`, by kind:

====================  ==========================================================================================
``gap`` ``split``     samples are missing; the phase is split, and the part after the gap is `truncated`
``interpolated``      lost samples in short gaps of smooth channels, which were interpolated
``pause``             nothing was measured while a device held its voltage and was read out
``non_finite``        samples that are not finite or beyond any stage; they are treated as a gap
``not_a_number``      cells of a table without a number
``duplicate``         samples that were received or written twice; the first ones are used
``non_monotonic``     samples that were received out of order, or a time that decreases
``restart``           the driver was restarted within a bag
``cut`` ``damaged``   the file ends early, or parts of it cannot be decoded
``truncated``         a phase without its beginning, or one that begins on a branch of its loop
``history``           earlier phases were played and not recorded
``moved``             the drive moved in the phase ``idle`` before the first phase
``step_before``       the displacement jumps with the first sample: a step from rest was not recorded
``rows_before``       rows before the chosen ones were read to determine the initial state
``proposed``          names of phases that were proposed from the shape of the drive
``left_out``          a phase, or a part of one, with fewer samples than are averaged into one
``averaged``          a recording too long for the memory, averaged on reading
``columns`` ``held``  the assignment of channels in a file of other software
``time_base``         times that are uneven, overlap, or are those of reception
====================  ==========================================================================================

and the kinds that `inspect` finds in the samples.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

from ..errors import RecordingError
from ..home_path import in_home
from ..record import Experiment, Notice, Record
from .bag.bag import Bag
from .bag.bag_writer import BagWriter
from .bag.rosbag2 import Rosbag2, recorded_model
from .checks.quality import inspect
from .checks.record_starts import checked_starts
from .columns import TableColumns, experiment_from, to_columns
from .formats.csv import Csv
from .formats.gcs_array import GcsArrayFormat
from .formats.known_formats import FORMATS, Format, TextFormat, WritableFormat
from .formats.mat import Mat
from .formats.npz import Npz
from .rows_before import with_rows_before
from .segmentation.decimating_buffer import left_out_notice
from .segmentation.decimation import load_decimation
from .table.read_options import Column, ReadOptions

__all__ = [
    "FORMATS", "Bag", "BagWriter", "Csv", "Format", "GcsArrayFormat", "Mat", "Npz", "ReadOptions", "Rosbag2",
    "from_columns", "inspect", "read", "recorded_model", "to_columns", "write",
]  # fmt: skip


def read(
    *paths: str | os.PathLike[str],
    format: str | None = None,
    axis: str | None = None,
    columns: Mapping[str, Column] | None = None,
    units: Mapping[str, str | float] | None = None,
    sample_period: float | None = None,
    initial_voltage: float | None = None,
    rows: tuple[int | None, int | None] | None = None,
    phases: str | Sequence[tuple[float, str]] | None = None,
    include: Sequence[str] = (),
    average: int | None = None,
    decimate: Mapping[str, int] | None = None,
    rows_before: int = 0,
) -> Experiment:
    """Read a recording, whatever its format, or several of one stage as one experiment.

    Parameters
    ----------
    *paths : path-like
        Files or folders. No recording continues the one before it.
    format : str, optional
        Key of `FORMATS`; by default it is inferred from the path.
    axis, columns, units, sample_period, initial_voltage, rows, phases, include, average
        Information that the file does not contain; see `ReadOptions`.
    decimate : mapping of str to int, optional
        Phase name to the number of samples that are averaged into one on reading (`Record.decimate`); default: the
        values that the identification node has written beside its bag, if any. A shorter record is left out.
    rows_before : int
        Largest number of rows in front of `rows` that are read too, as a phase ``conditioning``. The stage is not
        fitted or judged there, but its state is carried into `rows`. Without effect if `initial_voltage` is given.

    Returns
    -------
    Experiment
        In SI units; `notices` lists the findings about the data.

    Raises
    ------
    RecordingError
        If the path cannot be read as an experiment, `decimate` names an unknown phase, or every record is left out.
    RecordError
        If the samples do not form a record.
    """
    if not paths or "" in paths:
        raise RecordingError("read: got no path, expected a recording")
    options = ReadOptions(
        axis, columns or {}, units or {}, sample_period, initial_voltage, rows, phases, include, average
    )
    phases_found: list[str] = []
    records: list[Record] = []
    notices: list[Notice] = []
    for path in paths:
        place = in_home(path)
        chosen = _format(place, format)
        if axis is not None and not isinstance(chosen, Rosbag2):
            raise RecordingError(f"{path}: `axis`: got '{axis}', expected none; only a bag has namespaces of stages")
        found = with_rows_before(partial(_parts, place, chosen), options, rows_before)
        kept, left_out = _averaged(found, load_decimation(place) if decimate is None else decimate)
        phases_found += [r.phase for r in found]
        records += kept
        notices += [*found.notices, *left_out]
    if unknown := set(decimate or ()) - {name for phase in phases_found for name in (phase, phase.split("_")[0])}:
        held = ", ".join(dict.fromkeys(phases_found))
        raise RecordingError(f"{paths[0]}: `decimate`: no phase {min(unknown)!r}, expected one of {held}")
    if not records:
        raise RecordingError(f"{paths[0]}: {notices[-1].message}; expected a phase with enough samples")
    experiment = Experiment(tuple(records), ", ".join(str(in_home(path)) for path in paths))
    return experiment.noting(*notices, *inspect(experiment, options.units.get("displacement")))


def _averaged(experiment: Experiment, factors: Mapping[str, int]) -> tuple[list[Record], list[Notice]]:
    """The records with samples averaged by phase, without those that are too short for that, and what was left out."""
    records: list[Record] = []
    notices: list[Notice] = []
    for record in experiment:
        factor = factors.get(record.phase, factors.get(record.phase.split("_")[0]))
        if factor is not None and factor > record.size:
            notices.append(left_out_notice(record.size, factor, record.phase))
            continue
        if notices and not records and record.continues:  # the record that it continues was left out
            record = replace(record, continues=False, truncated=True)
        records.append(record if factor is None else record.decimate(factor))
    return records, notices


def from_columns(
    columns: TableColumns,
    *,
    names: Mapping[str, Column] | None = None,
    units: Mapping[str, str | float] | None = None,
    sample_period: float | None = None,
    initial_voltage: float | None = None,
) -> Experiment:
    """An experiment from arrays in memory: a pandas DataFrame, an xarray Dataset, a dict of arrays.

    Parameters
    ----------
    columns : mapping of str to (n,) array_like
        Titled as the columns of a CSV file, e.g. ``time_s``, ``voltage_V``, ``displacement_m``, ``phase``.
    names, units, sample_period, initial_voltage
        Information that the titles do not contain: as `columns`, `units`, … of `read`.

    Returns
    -------
    Experiment
        In SI units, checked as `read` checks a file.

    Raises
    ------
    RecordingError
        If voltage or displacement is missing, or the columns differ in length.

    Examples
    --------
    >>> columns = {"time_s": [0.0, 0.1, 0.2], "voltage_V": [0.0, 1.0, 0.0], "displacement_um": [0.0, 2.0, 0.5]}
    >>> from_columns(columns)[0].displacement.tolist()
    [0.0, 2e-06, 5e-07]
    """
    options = ReadOptions(None, names or {}, units or {}, sample_period, initial_voltage)
    experiment = checked_starts(experiment_from(columns, options), options)
    return experiment.noting(*inspect(experiment, options.units.get("displacement")))


def _parts(place: Path, chosen: Format, parts: Sequence[ReadOptions]) -> list[Experiment]:
    """Read one experiment of a path for each of `parts`."""
    if isinstance(chosen, TextFormat):
        read = chosen.read_parts(place, parts)
    else:
        read = [chosen.read(place, options) for options in parts]
    return [checked_starts(experiment, options) for experiment, options in zip(read, parts, strict=True)]


def write(experiment: Experiment, path: str | os.PathLike[str], *, format: str | None = None) -> None:
    """Write an experiment.

    Parameters
    ----------
    experiment : Experiment
        Records in order.
    path : path-like
        ``run.csv`` and ``run.mat`` give that file, ``run.mcap`` the bag folder ``run``, anything else a folder of NPZ.
    format : str, optional
        Key of `FORMATS`; by default it is inferred from the ending.

    Raises
    ------
    RecordingError
        If the format or the path cannot be written.
    """
    place = in_home(path)
    chosen = _named(format or _BY_SUFFIX.get(place.suffix.lower(), "npz"))
    if not isinstance(chosen, WritableFormat):
        raise RecordingError(f"{place}: format '{format}' is only read; expected npz, csv, mat or rosbag2")
    chosen.write(experiment, place)


_SEEN = {".aws": " (the binary stream of an attocube interferometer: export it as text; its positions are in pm)"}
"""Descriptions of files of other software that cannot be read, by the ending of their names."""
_BY_SUFFIX = {".csv": "csv", ".mat": "mat", ".mcap": "rosbag2"}
"""Format for each ending of a file name."""


def _named(format: str) -> Format:
    if format not in FORMATS:
        raise RecordingError(f"format: got '{format}', expected one of {', '.join(FORMATS)}")
    return FORMATS[format]


def _format(path: Path, name: str | None) -> Format:
    if not path.exists():
        raise RecordingError(f"{path}: no such file or folder, expected a recording")
    if not (path.is_file() or path.is_dir()):
        raise RecordingError(f"{path}: got a pipe or a device, expected a file or a folder")
    if name is not None:
        return _named(name)
    for chosen in FORMATS.values():
        if chosen.recognises(path):
            return chosen
    seen = "a folder" if path.is_dir() else f"a file ending '{path.suffix}'"
    seen += _SEEN.get(path.suffix.lower(), "")
    raise RecordingError(
        f"{path}: got {seen}, not a recording in a known format; expected one of {', '.join(FORMATS)}; "
        "choose one by `format`, or export the data as text"
    )
