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

"""CSV with a header that names units, and tables of other software: TSV, white space, no header."""

from __future__ import annotations

import io
from collections.abc import Sequence
from csv import writer
from dataclasses import replace
from pathlib import Path

from ...channel_mapping import QUANTITIES, quantity_of
from ...errors import RecordingError, printable
from ...record import Experiment, Notice, Record, Samples
from ..checks.error_context import naming
from ..segmentation.decimating_buffer import averaged_notice
from ..table.dialect import Dialect
from ..table.read_options import LABELS, ReadOptions, is_channel
from ..table.table import Places, resolve, table_records
from ..table.text_cells import Cells, read_cells
from ..table.time_column import TimeColumn
from ..whole_file import whole_file

ENDINGS = (".csv", ".tsv", ".txt", ".dat", ".asc", ".lvm")
"""Ends of the names of text tables."""
_ROWS = 1 << 15
"""Number of rows that are written together."""
_LOOK = 1 << 12
"""Number of first bytes by which a text is distinguished from other files."""
_EPOCH = 1e8
"""Times beyond this [s] count from an epoch, not from the start of the experiment."""
_SHOWN = 30
"""Largest number of characters of a cell in a message."""


class Csv:
    """Text table, one row per sample.

    Written with the header ``time_s,voltage_V,displacement_m,phase`` and, only where the records need them, the columns
    `record` (between neighbours of one name), `continues`, `truncated`, `initial_voltage_V`, `sample_period_s`,
    those of `Record.channels` with their unit, e.g. `other_displacement_m` and `temperature_K`, whose cells are empty
    in records without them. Numbers are written with all digits, so that reading returns the same values. Where start
    times count from an epoch, the column `start_time` holds them, and `time_s` counts from the first one.
    """

    def recognises(self, path: Path) -> bool:
        """True for the endings of text tables, and for any text with rows of numbers."""
        return path.is_file() and (path.suffix.lower() in ENDINGS or _is_table(path))

    def read(self, path: Path, options: ReadOptions) -> Experiment:
        """The table as phases: those of its labels, or phases proposed from the shape of the drive."""
        return self.read_parts(path, [options])[0]

    def read_parts(self, path: Path, parts: Sequence[ReadOptions]) -> list[Experiment]:
        """Parts of the table, each as `read`."""
        with naming(path, "a text table"):
            dialect = Dialect.sniff(path)
            found = resolve(dialect.header, dialect.width, parts[0])
            numbers = {name: at for name, (at, _) in found.columns.items() if is_channel(name)}
            words = {name: at for name, (at, _) in found.columns.items() if name in LABELS}
            read = read_cells(path, dialect, numbers, words, parts)
            return [_experiment(path, cells, found, options) for cells, options in zip(read, parts, strict=True)]

    def write(self, experiment: Experiment, path: Path) -> None:
        """Write all records into one table.

        Raises
        ------
        RecordingError
            If the file exists or cannot be written.
        """
        with naming(path, "a file that can be written"):
            if path.exists():
                raise RecordingError("exists already; choose another name")
            origin = experiment[0].start_time if abs(experiment[0].start_time) > _EPOCH else 0.0
            labels = _labels(experiment, origin)
            channels = list(dict.fromkeys(c for record in experiment for c in record.channels))
            with whole_file(path) as draft, draft.open("w", encoding="utf-8", newline="") as file:
                titles = [f"{c}_{QUANTITIES[quantity_of(c) or c]}" for c in channels]
                units = {"initial_voltage": "initial_voltage_V", "sample_period": "sample_period_s"}
                titles += [units.get(name, name) for name in labels]
                file.write(",".join(["time_s", "voltage_V", "displacement_m", *titles]) + "\n")
                for number, record in enumerate(experiment, 1):
                    _write_record(file, record, origin, channels, _row_end(number, record, labels))


def _experiment(path: Path, cells: Cells, found: Places, options: ReadOptions) -> Experiment:
    channels = {name: options.in_si(name, values, found.columns[name][1]) for name, values in cells.columns.items()}
    if "time" in channels and abs(channels["time"][0]) > _EPOCH:
        channels["time"] = channels["time"] - channels["time"][0]
    rest = options.after_reading(cells.average)
    records, notices = table_records(channels, cells.marks, rest, truncated=options.passes_over)
    notices += found.notices
    if options.average is None and cells.average > 1:
        notices.append(averaged_notice(cells.average, records[0].sample_period))
    if cells.is_cut:
        notices.append(Notice("cut", "the file ends within a row, which was left out"))
    if cells.bad:
        example = f", e.g. '{printable(cells.example[:_SHOWN])}'" if cells.example else ""
        notices.append(Notice("not_a_number", f"{cells.bad} cells are empty or hold no number{example}"))
    return Experiment(tuple(records), str(path), tuple(notices))


def _is_table(path: Path) -> bool:
    with path.open("rb") as file:
        if b"\0" in file.read(_LOOK):
            return False
    try:
        return len(Dialect.sniff(path).header) > 0
    except RecordingError:
        return False


def _times(record: Record, origin: float) -> Samples:
    """Time of every sample since `origin` [s]."""
    return replace(record, start_time=record.start_time - origin).time


def _labels(experiment: Experiment, origin: float) -> list[str]:
    """Label columns that are needed to read the same records again."""
    labels = ["phase"]
    pairs = list(zip(experiment.records, experiment.records[1:], strict=False))
    if any(a.phase == b.phase for a, b in pairs):
        labels.append("record")
    inferred = [abs(b.start_time - a.start_time - a.duration) < 1.5 * b.sample_period for a, b in pairs]
    if [False, *inferred] != [r.continues for r in experiment]:
        labels.append("continues")
    if any(r.truncated for r in experiment):
        labels.append("truncated")
    if any(r.initial_voltage is not None for r in experiment):
        labels.append("initial_voltage")
    if any(r.size < 2 or TimeColumn.of(_times(r, origin)).period != r.sample_period for r in experiment):
        labels.append("sample_period")
    if origin:
        labels.append("start_time")
    return labels


def _row_end(number: int, record: Record, labels: list[str]) -> str:
    values = {
        "phase": record.phase,
        "record": number,
        "continues": int(record.continues),
        "truncated": int(record.truncated),
        "initial_voltage": "" if record.initial_voltage is None else repr(record.initial_voltage),
        "sample_period": repr(record.sample_period),
        "start_time": repr(record.start_time),
    }
    text = io.StringIO()
    writer(text, lineterminator="").writerow([values[name] for name in labels])
    return text.getvalue().replace("\n", " ").replace("\r", " ") + "\n"


def _write_record(file: io.TextIOBase, record: Record, origin: float, channels: list[str], end: str) -> None:
    columns = [_times(record, origin), record.voltage, record.displacement, *(record.channels.get(c) for c in channels)]
    for a in range(0, record.size, _ROWS):
        size = min(_ROWS, record.size - a)
        cells = [[""] * size if c is None else map(repr, c[a : a + size].tolist()) for c in columns]
        file.write("".join(",".join(row) + "," + end for row in zip(*cells, strict=True)))
