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

"""`attempt`: processes one recording in a worker process, from its URL to its row."""

from __future__ import annotations

import os
import socket
import time
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from dataclasses import dataclass
from datetime import UTC, datetime
from enum import StrEnum
from functools import partial
from typing import Any

from .. import recording
from ..errors import PiezoError, printable, reason_of
from .code_hash import code_hash
from .extra import package
from .fetching import content_hash, fetch
from .source import Source
from .time_limit import RecordingTimeSpent, run_within
from .work import Work

Row = dict[str, Any]
LATE = "piezo_fleet_late"
"""Topic of the events of Dask that hold the tasks whose process the time limit has ended."""
SENDING = 1.0
"""Time for which such an event is sent before the process ends [s]."""


class RowStatus(StrEnum):
    """Result of the work on a recording."""

    DONE = "done"
    """The row holds the result of the task."""
    FAILED = "failed"
    """The recording could not be read, or the task ended with an error."""
    TIMED_OUT = "timed_out"
    """There was no result within the time limit."""
    UNREACHABLE = "unreachable"
    """The recording could not be fetched from its storage."""
    KILLED = "killed"
    """The worker process ended in every attempt."""
    UNCHANGED = "unchanged"
    """The data equal those of the existing row, which is kept."""


class OtherCodeError(PiezoError):
    """A worker runs another version of this package than the client."""


@dataclass(frozen=True, slots=True)
class Order:
    """What a worker has to do: one task for one recording.

    Parameters
    ----------
    source : Source
        The recording.
    work : Work
        The task.
    reading : mapping of str to object
        Arguments of `recording.read`.
    settings : str
        Hash of `work` and `reading`.
    code : str
        `code_hash` of the client.
    limit : float
        Time limit [s].
    known : str
        Hash of the data of an existing row; equal data are not processed again. Empty if there is no row.
    """

    source: Source
    work: Work
    reading: Mapping[str, Any]
    settings: str
    code: str
    limit: float = float("inf")
    known: str = ""

    def row(self, status: RowStatus, **columns: Any) -> Row:
        """A row with the data of the order, and `columns`."""
        source = self.source
        return {
            "recording": source.url,
            "task": self.work.name,
            "stage": source.stage,
            "month": source.month,
            "recorded_at": source.recorded_at,
            "status": str(status),
            "code_hash": self.code,
            "settings_hash": self.settings,
            "version": source.version,
            "time_limit_s": self.limit,
            "finished_at": datetime.now(UTC),
            **columns,
        }


def attempt(order: Order) -> Row:
    """Process one recording. An error in the recording, the task or the storage becomes part of the row.

    Parameters
    ----------
    order : Order

    Returns
    -------
    dict
        The row: values by column, see `table.schema`.

    Raises
    ------
    OtherCodeError
        If this process runs other code than the client: the code hash in the row would be wrong.
    """
    if code_hash() != order.code:
        raise OtherCodeError(
            f"the worker on {socket.gethostname()} runs {code_hash()} of piezo_hysteresis, expected {order.code}; "
            "install the same version on every machine"
        )
    began, spent = time.monotonic(), time.process_time()
    columns: Row = {}
    try:
        status = run_within(order.limit, partial(_process, order, columns), _end_of_worker())
    except RecordingTimeSpent:
        status = RowStatus.TIMED_OUT
        columns["error"] = _late(order)
    columns |= {"seconds": time.monotonic() - began, "processor_seconds": time.process_time() - spent}
    return order.row(status, worker=f"{socket.gethostname()}", **columns)


def _process(order: Order, columns: Row) -> RowStatus:
    with ExitStack() as stack:
        return _read_and_work(order, stack, columns)


def _read_and_work(order: Order, stack: ExitStack, columns: Row) -> RowStatus:
    try:
        path = fetch(order.source, stack)
        columns["data_hash"] = content_hash(order.source, path)
    except Exception as error:  # storages raise different exceptions
        columns["error"] = f"{type(error).__name__}: {_line(error)}"
        return RowStatus.UNREACHABLE
    if columns["data_hash"] == order.known:
        return RowStatus.UNCHANGED
    try:
        experiment = recording.read(path, **order.reading)
        columns |= {
            "samples": experiment.size,
            "duration_s": sum(r.duration for r in experiment),
            "range_m": experiment.range,
        }
        columns |= order.work(experiment).columns()
    except MemoryError:
        columns["error"] = "the recording does not fit into memory; decimate it or give fewer rows"
        return RowStatus.FAILED
    except Exception as error:  # a fault of this program must affect only one row
        columns["error"] = reason_of(error).replace(str(path), order.source.url)
        return RowStatus.FAILED
    return RowStatus.DONE


def _late(order: Order) -> str:
    return f"no result within the time limit of {order.limit:g} s; increase --time-limit"


def _end_of_worker() -> Callable[[], None] | None:
    """A function that ends this worker, and first says in the events `LATE` for which task; None outside of Dask."""
    try:
        worker = package("distributed").get_worker()
    except ValueError:
        return None
    key = str(worker.get_current_task())

    def end() -> None:
        worker.log_event(LATE, key)
        time.sleep(SENDING)
        os._exit(1)

    return end


def _line(error: BaseException) -> str:
    return printable(" ".join(str(error).split()))


def lost(order: Order, is_late: bool) -> Row:
    """The row of a recording without a result because worker processes ended.

    Parameters
    ----------
    order : Order
    is_late : bool
        Whether the time limit ended the process; otherwise each attempt ended for another reason.

    Returns
    -------
    dict
        The row: values by column.
    """
    if is_late:
        return order.row(RowStatus.TIMED_OUT, error=f"{_late(order)}; a library did not return, its process was ended")
    reason = "the worker process ended in every attempt: too little memory, or a crash in a library"
    return order.row(RowStatus.KILLED, error=reason)
