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

"""PI GCS arrays, which controllers send as the answer to ``DRR?`` and PIMikroMove saves."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

from ...channel_mapping import quantity_of
from ...errors import RecordingError
from ...gcs_header import END, gcs_header, gcs_separator
from ...record import Experiment, Notice
from ..checks.error_context import naming
from ..segmentation.decimating_buffer import averaged_notice
from ..table.dialect import Dialect, decoded
from ..table.read_options import ReadOptions, is_channel
from ..table.table import resolve, table_records
from ..table.text_cells import BLOCK_BYTES, Cells, read_cells


class GcsArrayFormat:
    """Text with ``# KEY = value`` lines up to ``# END_HEADER``, then rows of numbers.

    Without a mapping, the first column named as a voltage is the drive [V]. The first column named as a position, other
    than a commanded or target position, is the displacement [µm].
    """

    def recognises(self, path: Path) -> bool:
        """True where the first block holds the end of a GCS header."""
        if not path.is_file():
            return False
        with path.open("rb") as file:
            return f"# {END}".encode() in file.read(BLOCK_BYTES // 16)

    def read(self, path: Path, options: ReadOptions) -> Experiment:
        """The array as phases, which are named by the shape of the drive unless `ReadOptions.phases` names them."""
        return self.read_parts(path, [options])[0]

    def read_parts(self, path: Path, parts: Sequence[ReadOptions]) -> list[Experiment]:
        """Parts of the array, each as `read`."""
        with naming(path, "a GCS array"):
            header, skipped = _header(path)
            width = int(header.get("DIM", "0"))
            titles = [header.get(f"NAME{i}", f"column {i + 1}") for i in range(min(width, 1000))]
            if width < 2 or width > 1000:
                raise RecordingError(f"got DIM = {width}, expected two to 1000 columns")
            inferred = {"voltage": _first(titles, "volt"), "displacement": _first(titles, "position|displacement")}
            columns = {c: at for c, at in inferred.items() if at} | dict(parts[0].columns)
            places = resolve(titles, width, ReadOptions(columns=columns, sample_period=1.0)).columns
            dialect = Dialect(gcs_separator(header), False, skipped, (), width)
            numbers = {name: at for name, (at, _) in places.items() if is_channel(name)}
            said = ", ".join(f"{name} = '{titles[at]}'" for name, at in numbers.items())
            used = Notice("columns", f"columns used: {said}; positions without a unit are taken in µm")
            read = read_cells(path, dialect, numbers, {}, parts)
            return [_experiment(path, c, header, used, options) for c, options in zip(read, parts, strict=True)]


def _experiment(path: Path, cells: Cells, header: dict[str, str], used: Notice, options: ReadOptions) -> Experiment:
    channels = {
        name: options.in_si(name, column, "um" if quantity_of(name) == "displacement" else None)
        for name, column in cells.columns.items()
    }
    period = options.sample_period or float(header.get("SAMPLE_TIME", "nan"))
    rest = options.with_period(period if period > 0 else None).after_reading(cells.average)
    records, notices = table_records(channels, [], rest, truncated=options.passes_over)
    notices.append(used)
    declared, size = int(header.get("NDATA", "-1")), channels["voltage"].size
    if declared >= 0 and options.rows is None and cells.average == 1 and size != declared:
        notices.append(Notice("cut", f"the file has {size} of the {declared} rows that its header declares"))
    if options.average is None and cells.average > 1:
        notices.append(averaged_notice(cells.average, records[0].sample_period))
    if cells.bad:
        notices.append(Notice("not_a_number", f"{cells.bad} cells are empty or hold no number"))
    return Experiment(tuple(records), str(path), tuple(notices))


def _header(path: Path) -> tuple[dict[str, str], int]:
    """Keys of the header and its number of lines."""
    with path.open("rb") as file:
        found = gcs_header(decoded(file.read(BLOCK_BYTES // 16)).splitlines())
    if found is None:
        raise RecordingError(f"got no line '# {END}', expected a GCS array")
    return found


def _first(titles: list[str], words: str) -> int | None:
    """Number, from 1, of the first measured column whose title contains one of the `words`."""
    wanted, target = re.compile(words, re.IGNORECASE), re.compile("command|target|error", re.IGNORECASE)
    hits = [i for i, title in enumerate(titles, 1) if wanted.search(title)]
    return next((i for i in hits if not target.search(titles[i - 1])), hits[0] if hits else None)
