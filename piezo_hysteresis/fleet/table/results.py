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

"""`Results`: the folder of results, a table in Parquet with one row per recording and task.

Rows are first written as small files (parts) in the folder of their partition. Every file is written atomically. Parts
are merged into one file when there are many, and at the end. A killed run may leave parts, also parts whose rows are
merged already. The next run removes them before it begins.
"""

from __future__ import annotations

import fcntl
import os
from collections import defaultdict
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from datetime import datetime
from pathlib import Path
from types import TracebackType
from typing import Any, Self
from urllib.parse import quote, unquote

from ...errors import RecordingError
from ..attempt import Row
from ..extra import package
from .schema import PARTITIONS, schema

MERGED = "rows.parquet"
"""Name of the file of a partition into which its parts are merged."""
MOST_PARTS = 20
"""Number of parts in a partition at which they are merged."""
INDEX = (
    "recording", "task", "status", "data_hash", "code_hash", "settings_hash", "version", "time_limit_s", "finished_at",
)  # fmt: skip
"""Columns that decide whether a recording has to be processed again."""


@dataclass(frozen=True, slots=True)
class Known:
    """Columns of an existing row that decide whether its recording has to be processed again, and its file.

    `time_limit` is in seconds, infinite for none; `finished_at` is in UTC.
    """

    status: str
    data_hash: str
    code_hash: str
    settings_hash: str
    version: str
    time_limit: float
    finished_at: datetime
    file: Path


class Results:
    """The results in a folder, for one process at a time; use it in a ``with`` block.

    Parameters
    ----------
    folder : Path
        Folder of the results; it is created if it does not exist.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.known: dict[tuple[str, str], Known] = {}
        """The existing rows, by task and recording."""
        self._new: list[Row] = []
        self._changed: set[Path] = set()
        self._number = 0
        self._lock = -1

    def __enter__(self) -> Self:
        """Lock the folder, read it, and repair the remains of a killed run.

        Raises
        ------
        RecordingError
            If another process uses the folder, or it cannot be read or written.
        """
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            self._lock = os.open(self.folder / ".lock", os.O_RDWR | os.O_CREAT, 0o644)
            fcntl.flock(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise RecordingError(f"{self.folder}: another process writes results there; wait until it ends") from None
        except OSError as error:
            raise RecordingError(f"{self.folder}: {error.strerror or error}, expected a folder for results") from None
        for draft in self.folder.glob("stage=*/month=*/.*.tmp"):
            draft.unlink()
        for file in sorted(self.folder.glob("stage=*/month=*/*.parquet")):
            if file.name != MERGED:
                self._changed.add(file.parent)
            self._index(file)
        self.merge()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Write the remaining rows, merge, unlock."""
        try:
            self.flush()
            self.merge()
        finally:
            os.close(self._lock)

    def add(self, row: Row) -> None:
        """Add a row, which replaces the row of the same recording and task; `flush` writes it to disk."""
        self._new.append(row)

    @property
    def waiting(self) -> int:
        """Number of rows that are not on disk yet."""
        return len(self._new)

    def flush(self) -> None:
        """Write the added rows to disk; RecordingError if the folder cannot be written."""
        groups: dict[Path, list[Row]] = defaultdict(list)
        for row in self._new:
            names = (f"{column}={quote(str(row[column]), safe='')}" for column in PARTITIONS)
            groups[self.folder.joinpath(*names)].append(row)
        for place, rows in groups.items():
            self._number += 1
            part = place / f"part-{os.getpid()}-{self._number:08d}.parquet"
            _write(package("pyarrow").Table.from_pylist(rows, schema=schema()), part)
            self._changed.add(place)
            for row in rows:
                self._note({name: row.get(name) for name in INDEX}, part)
        self._new = []
        for place in [p for p in self._changed if sum(1 for _ in p.glob("part-*.parquet")) >= MOST_PARTS]:
            self._merge(place)

    def merge(self) -> None:
        """Merge every partition into one file, without replaced rows."""
        for place in sorted(self._changed):
            self._merge(place)

    def rows(self, recordings: Iterable[tuple[str, str]]) -> Iterator[Row]:
        """The complete rows of some recordings, each given as (task, recording)."""
        wanted: dict[Path, set[tuple[str, str]]] = defaultdict(set)
        for identity in recordings:
            wanted[self.known[identity].file].add(identity)
        for file, identities in wanted.items():
            stage, month = _partition(file.parent)
            for row in _read(file).to_pylist():
                if (row["task"], row["recording"]) in identities:
                    yield {**row, "stage": stage, "month": month}

    def _index(self, file: Path) -> None:
        for entry in _read(file, list(INDEX)).to_pylist():
            self._note(entry, file)

    def _note(self, entry: dict[str, Any], file: Path) -> None:
        identity = entry["task"], entry["recording"]
        before = self.known.get(identity)
        if before is not None:
            if before.finished_at > entry["finished_at"]:
                self._changed.add(file.parent)
                return
            self._changed.add(before.file.parent)
        self.known[identity] = Known(
            entry["status"],
            entry["data_hash"] or "",
            entry["code_hash"] or "",
            entry["settings_hash"] or "",
            entry["version"] or "",
            float("inf") if entry["time_limit_s"] is None else entry["time_limit_s"],
            entry["finished_at"],
            file,
        )

    def _merge(self, place: Path) -> None:
        pa = package("pyarrow")
        merged = place / MERGED
        files = sorted(place.glob("*.parquet"))
        kept, seen = [], set()
        for file in files:
            table = _read(file)
            mask = []
            for task, recording, time in zip(
                *(table[name].to_pylist() for name in ("task", "recording", "finished_at")), strict=True
            ):
                identity = task, recording
                current = self.known[identity]
                mask.append(current.finished_at == time and current.file.parent == place and identity not in seen)
                if mask[-1]:
                    seen.add(identity)
            kept.append(table.filter(pa.array(mask, pa.bool_())))
        if seen:
            _write(pa.concat_tables(kept), merged)
        for file in files:
            if file != merged or not seen:
                file.unlink()
        for identity in seen:
            self.known[identity] = replace(self.known[identity], file=merged)
        self._changed.discard(place)


def read_results(folder: Path, columns: list[str] | None = None) -> Any:
    """Read all rows, with the columns ``stage`` and ``month``.

    Parameters
    ----------
    folder : Path
        Folder written by `Results`.
    columns : list of str, optional
        Columns to read; default: all.

    Returns
    -------
    pyarrow.Table

    Raises
    ------
    RecordingError
        If the folder contains no results.
    """
    pa = package("pyarrow")
    tables = []
    for file in sorted(folder.glob("stage=*/month=*/*.parquet")):
        wanted = None if columns is None else [c for c in columns if c not in PARTITIONS]
        table = _read(file, wanted)
        for column, value in zip(PARTITIONS, _partition(file.parent), strict=True):
            if columns is None or column in columns:
                table = table.append_column(column, pa.array([value] * table.num_rows, pa.string()))
        tables.append(table)
    if not tables:
        raise RecordingError(f"{folder}: got no results, expected a folder that piezo fleet has written")
    return pa.concat_tables(tables)


def _partition(place: Path) -> tuple[str, str]:
    return unquote(place.parent.name.partition("=")[2]), unquote(place.name.partition("=")[2])


def _read(file: Path, columns: list[str] | None = None) -> Any:
    try:
        return package("pyarrow.parquet").ParquetFile(file).read(columns=columns)
    except (OSError, ValueError) as error:
        raise RecordingError(f"{file}: {error}; expected a table of piezo fleet; remove the file") from None


def _write(table: Any, file: Path) -> None:
    draft = file.with_name(f".{file.name}.tmp")
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        package("pyarrow.parquet").write_table(table, draft, compression="zstd")
        draft.replace(file)
    except OSError as error:
        raise RecordingError(f"{file}: {error.strerror or error}, expected a folder that can be written") from None
