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

"""`run_fleet`: processes many recordings and writes one row for each."""

from __future__ import annotations

import hashlib
import time
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from ..errors import counted
from .attempt import Order, Row, RowStatus
from .code_hash import code_hash
from .dispatch import finished
from .source import Source
from .table.results import Known, Results
from .work import Work

FLUSH_TIME, FLUSH_ROWS = 20.0, 1000
"""Time [s] and number of rows after which rows are written. A killed run loses the rows that were not written yet."""
Progress = Callable[[str, float], None]
"""Function of a message and of the fraction done, 0 to 1."""


@dataclass(frozen=True, slots=True)
class FleetSummary:
    """Summary of a run.

    Parameters
    ----------
    counts : mapping of str to int
        Number of recordings by status. ``unchanged`` counts files that have a new version but contain the same data.
    seconds : float
        Duration of the run [s].
    """

    counts: Mapping[str, int]
    seconds: float

    def sentence(self) -> str:
        """The run in one line.

        >>> FleetSummary({"done": 3, "timed_out": 1}, 12.0).sentence()
        '4 recordings in 12 s: 3 done, 1 timed out.'
        """
        words = ", ".join(f"{count} {status.replace('_', ' ')}" for status, count in sorted(self.counts.items()))
        return f"{counted(sum(self.counts.values()), 'recording')} in {self.seconds:.0f} s: {words or 'nothing to do'}."


def settings_hash(work: Work, reading: Mapping[str, Any]) -> str:
    """Hash of the options that influence a result: ``sha256:`` and 16 digits."""
    given = sorted((name, repr(value)) for name, value in reading.items() if value not in (None, {}, [], ()))
    return "sha256:" + hashlib.sha256(f"{work.settings()}\n{given}".encode()).hexdigest()[:16]


def open_orders(
    sources: Sequence[Source],
    work: Work,
    results: Results,
    *,
    reading: Mapping[str, Any] | None = None,
    limit: float = float("inf"),
    retry: bool = False,
) -> list[Order]:
    """Orders for the recordings that have to be processed: without a row, or with changed data, code or options.

    Parameters
    ----------
    sources : sequence of Source
    work : Work
    results : Results
        Results so far.
    reading : mapping, optional
        Arguments of `recording.read`.
    limit : float
        Time limit per recording [s]; a recording that exceeded a smaller limit is tried again.
    retry : bool
        Whether recordings that failed are tried again.

    Returns
    -------
    list of Order
    """
    reading, code = dict(reading or {}), code_hash()
    settings = settings_hash(work, reading)
    orders = []
    for source in sources:
        known = results.known.get((work.name, source.url))
        same = known is not None and (known.code_hash, known.settings_hash) == (code, settings)
        valid = same and known is not None and _is_final(known, limit, retry)
        if valid and known is not None and known.version == source.version != "":
            continue
        keep = known.data_hash if valid and known is not None else ""
        orders.append(Order(source, work, reading, settings, code, limit, keep))
    return orders


def _is_final(known: Known, limit: float, retry: bool) -> bool:
    if known.status == RowStatus.DONE:
        return True
    if retry or known.status == RowStatus.UNREACHABLE:
        return False
    return known.status != RowStatus.TIMED_OUT or limit <= known.time_limit


def run_fleet(orders: Sequence[Order], results: Results, client: Any, progress: Progress | None = None) -> FleetSummary:
    """Process recordings and write each row when its recording is finished.

    Parameters
    ----------
    orders : sequence of Order
        Orders from `open_orders`.
    results : Results
        Results, open for writing.
    client : distributed.Client
        Client from `cluster`.
    progress : callable, optional
        Called with a message and the fraction done, 0 to 1.

    Returns
    -------
    FleetSummary

    Raises
    ------
    OtherCodeError
        If a worker runs another version of this package.
    RecordingError
        If the scheduler is lost; finished rows are kept.
    """
    began = flushed = time.monotonic()
    counts: Counter[str] = Counter()
    unchanged: list[Row] = []
    try:
        for rows in finished(orders, client):
            for row in rows:
                counts[row["status"]] += 1
                if row["status"] == RowStatus.UNCHANGED:
                    unchanged.append(row)
                else:
                    results.add(row)
            if results.waiting >= FLUSH_ROWS or time.monotonic() - flushed > FLUSH_TIME:
                results.flush()
                flushed = time.monotonic()
            if progress is not None:
                done = counts.total()
                without = done - counts[RowStatus.DONE] - counts[RowStatus.UNCHANGED]
                progress(f"{done} of {len(orders)} recordings, {without} without result", done / max(len(orders), 1))
    finally:
        _refresh(results, unchanged)
        results.flush()
    return FleetSummary(dict(+counts), time.monotonic() - began)


def _refresh(results: Results, unchanged: Sequence[Row]) -> None:
    """Write the new version and dates into the rows of recordings whose files changed but whose data did not."""
    now = {(row["task"], row["recording"]): row for row in unchanged}
    fresh = ("version", "stage", "month", "recorded_at", "finished_at")
    for row in list(results.rows(now)):
        seen = now[row["task"], row["recording"]]
        results.add({**row, **{column: seen[column] for column in fresh}})
