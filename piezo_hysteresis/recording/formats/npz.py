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

"""A folder of ``NN_<phase>.npz``, one file per phase: the simplest form of an experiment."""

from __future__ import annotations

import re
import zipfile
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np

from ...channel_mapping import axis_of
from ...errors import RecordingError
from ...record import Experiment, Notice, Record, Samples
from ..checks.error_context import naming
from ..checks.split_at_gaps import split_at_gaps
from ..segmentation.decimating_buffer import averaged_notice, shared_averages
from ..segmentation.phases import labelled
from ..table.column_inference import (
    axis_columns,
    inference_notice,
    inferred_columns,
    inferred_period,
    period_of,
    require_different,
    unit_of,
)
from ..table.read_options import CHANNELS, LABELS, ReadOptions, is_channel
from ..table.time_column import TimeColumn
from ..whole_file import whole_file
from .npz_members import NpzMembers

_EXPECTED = "an .npz file with voltage, displacement and sample_period"
"""What is expected in place of a file that cannot be read."""
_NUMBERED = re.compile(r"\d+[_ -]")
"""Number in front of the name of a phase."""


class Npz:
    """Folder of ``NN_<phase>.npz`` files, or one such file.

    Keys `voltage` [V], `displacement` [m], `sample_period` [s], `start_time` [s] and `phase`; optional `continues`,
    `truncated`, `initial_voltage` [V], and further channels as in `Record.channels`, e.g. `other_displacement` [m],
    `temperature` [K], `displacement_3` [m]. Other keys are ignored, unless `ReadOptions.columns` names them for a
    channel. Pickled objects are refused.
    """

    def recognises(self, path: Path) -> bool:
        """True for an .npz file or a folder that holds one."""
        return path.suffix == ".npz" if path.is_file() else any(path.glob("*.npz"))

    def read(self, path: Path, options: ReadOptions) -> Experiment:
        """The phases in the order of their file numbers."""
        files = [path] if path.is_file() else sorted(path.glob("*.npz"), key=_order)
        if strange := [file.name for file in files if not file.is_file()]:
            raise RecordingError(f"{path}: {strange[0]} is no regular file, expected .npz files only")
        records: list[Record] = []
        notices: list[Notice] = []
        if len(files) > 1 and not isinstance(options.phases, str | None):
            raise RecordingError(f"{path}: got start times of phases for {len(files)} files, expected one record")
        end = 0.0
        sizes = []
        for file in files:
            with naming(file, _EXPECTED):
                sizes.append(_size(file, options))
        for file, size, average in zip(files, sizes, shared_averages(sizes, options.average), strict=True):
            if size < average:
                message = f"{file.name} has {size} samples, fewer than the {average} that make one; it was left out"
                notices.append(Notice("left_out", message))
                continue
            with naming(file, _EXPECTED):
                parts, more_notices = _phase(file, options, average, end)
            records += parts
            notices += more_notices
            end = parts[-1].start_time + parts[-1].duration
        if not records:
            if max(sizes) == 0:
                raise RecordingError(f"{path}: got no sample, expected at least one")
            raise RecordingError(f"{path}: `average`: got {options.average}, expected at most {max(sizes)} samples")
        return Experiment(tuple(records), str(path), tuple(notices))

    def write(self, experiment: Experiment, path: Path) -> None:
        """Write every record to its file in a folder that holds no other experiment.

        Raises
        ------
        RecordingError
            If the folder already holds .npz files or cannot be written.
        """
        with naming(path, "a folder that can be written"):
            path.mkdir(parents=True, exist_ok=True)
            if any(path.glob("*.npz")):
                raise RecordingError("holds an experiment already; choose an empty folder")
            with ExitStack() as written:  # they get their names together, at the end
                for number, record in enumerate(experiment, 1):
                    name = re.sub(r"[^\w.+-]", "_", record.phase)
                    draft = written.enter_context(whole_file(path / f"{number:02d}_{name}.npz"))
                    with draft.open("wb") as file:
                        np.savez(file, **_keys(record))


def _places(values: NpzMembers, options: ReadOptions) -> tuple[dict[str, str], dict[str, str]]:
    """Key of every channel and label, and the channels whose keys were inferred."""
    place = {name: str(options.columns.get(name, name)) for name in (*CHANNELS, *options.columns, *LABELS)}
    timed = options.sample_period is not None or "sample_period" in values or "sample_period" in options.columns
    wanted = ("voltage", "displacement") if timed or _period(values) else ("time", "voltage", "displacement")
    open_ = [c for c in wanted if c not in options.columns and c not in values]
    names = [name for name in values if name not in place.values()]
    inferred = {c: names[at] for c, at in inferred_columns(names, (), open_).items()}
    place |= inferred
    require_different({c: place[c] for c in (*CHANNELS, *options.columns) if is_channel(c)})
    names = [name for name in values if name not in place.values()]
    place = {c: names[at] for c, at in axis_columns(names, ()).items()} | place
    others = {name: name for name in values if is_channel(name) and name not in (*place, *place.values())}
    return others | place, inferred


def _period(values: NpzMembers) -> tuple[str, float] | None:
    """First key that is called like a sample period and holds one number, and the period [s]."""
    for name in values:
        if (found := inferred_period([name])) and values.size(name) == 1:
            return name, period_of(name, values.number(name), found[1])
    return None


def _size(file: Path, options: ReadOptions) -> int:
    """Number of samples that the options select from a file, before averaging."""
    with zipfile.ZipFile(file) as archive:
        values = NpzMembers(archive, file.stat().st_size)
        part = options.part(values.size(_places(values, options)[0]["voltage"]))
        return part.stop - part.start


def _phase(file: Path, options: ReadOptions, average: int, end: float) -> tuple[list[Record], list[Notice]]:
    """Records of one file; `end` is the end of the previous file [s]."""
    with zipfile.ZipFile(file) as archive:
        values = NpzMembers(archive, file.stat().st_size)
        place, inferred = _places(values, options)
        units = {c: unit_of(name, c, options.units) for c, name in place.items() if is_channel(c)}
        part = options.part(values.size(place["voltage"]))

        def channel(name: str) -> Samples:
            return options.in_si(name, values.samples(place[name], part, average), units.get(name))

        def number(name: str, default: float | None) -> float | None:
            return values.number(place[name]) if place[name] in values else default

        def fits(name: str) -> bool:
            return values.size(place[name]) == values.size(place["voltage"])

        period, gaps, more_notices = _time_base(values, place, options, lambda: channel("time"), average)
        others = [c for c in units if c not in CHANNELS and (c in options.columns or axis_of(c) or fits(c))]
        named = place["phase"] in values or _NUMBERED.match(file.name)
        records, notices = split_at_gaps(
            {name: channel(name) for name in ("voltage", "displacement", *others)},
            period,
            *gaps,
            phase=values.text(place["phase"], _NUMBERED.sub("", file.stem)),
            start_time=number("start_time", end),
            continues=bool(number("continues", 0.0)),
            truncated=bool(number("truncated", 0.0)) or options.truncates(part),
            initial_voltage=number("initial_voltage", None),
        )
    notices += [*more_notices, *inference_notice(inferred, units)]
    if options.average is None and average > 1:
        notices.append(averaged_notice(average, period, records[0].phase))
    if named and options.phases is None:
        return records, notices
    records, more_notices = labelled(records, options.phases)
    return records, [*notices, *more_notices]


def _time_base(
    values: NpzMembers, place: dict[str, str], options: ReadOptions, times: Callable[[], Samples], average: int
) -> tuple[float, tuple[dict[int, int], ...], list[Notice]]:
    """Sample period [s] from the file; the missing samples, if the file holds times; notices."""
    if options.sample_period is not None:
        if place["time"] in values and values.size(place["time"]) > average:
            TimeColumn.of(times()).require(options.sample_period * average)
        return options.sample_period * average, (), []
    if place["sample_period"] in values or "sample_period" in options.columns:
        given = options.in_si("sample_period", np.array(values.number(place["sample_period"])))
        return float(given) * average, (), []
    if place["time"] in values or "time" in options.columns:
        base = TimeColumn.of(times())
        return base.period, base.gaps, base.notices()
    if (found := _period(values)) is not None:
        name, period = found
        return period * average, (), list(inference_notice({"sample_period": name}, {}))
    return values.number(place["sample_period"]), (), []  # raises the error that lists the keys


def _keys(record: Record) -> dict[str, Any]:
    keys: dict[str, Any] = {
        "voltage": record.voltage,
        "displacement": record.displacement,
        "sample_period": record.sample_period,
        "start_time": record.start_time,
        "phase": record.phase,
    }
    keys |= {name: True for name in ("continues", "truncated") if getattr(record, name)}
    if record.initial_voltage is not None:
        keys["initial_voltage"] = record.initial_voltage
    return keys | dict(record.channels)


def _order(file: Path) -> tuple[float, str]:
    number = re.match(r"\d{1,9}", file.name)
    return (float(number[0]) if number else float("inf"), file.name)
