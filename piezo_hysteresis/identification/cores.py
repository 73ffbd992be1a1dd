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

"""`on_cores`: a loop whose items are independent; helper processes on the other cores compute items further ahead.

The results are the same, bit for bit, as without helpers. An item that a helper cannot compute is computed here.
Processes, because most of the time of a fit is spent in Python, where threads wait for each other. Nothing else of a
diagnosis knows of processes.
"""

from __future__ import annotations

import os
import pickle
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import CancelledError, Future
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from dataclasses import dataclass
from queue import SimpleQueue
from typing import Any, BinaryIO, TypeVar

import numpy as np

from .fit.time_limit import end_of_search, ending_at
from .one_core import on_one_core

Item = TypeVar("Item")
Result = TypeVar("Result")

Wanted = Callable[[Any], bool]

MOST = 4
"""Largest number of cores that are used; loops of a diagnosis have about this number of long items."""


class _Helpers:
    """Helper processes, each served by a thread, which waits until its process has started.

    No `ThreadPoolExecutor`: a Ctrl-C while it takes an item can leave one of its locks held, and its end then waits for
    ever. Nothing waits for these threads, and a `SimpleQueue` has no such lock.
    """

    def __init__(self, count: int) -> None:
        self._count = count
        self._processes: list[subprocess.Popen[bytes]] = []
        self._jobs: SimpleQueue[_Job | None] = SimpleQueue()

    @property
    def are_started(self) -> bool:
        return bool(self._processes)

    def start(self) -> None:
        if self.are_started:
            return
        command = [sys.executable, "-c", f"from {__name__} import serve; serve()"]
        environment = {**os.environ, "PYTHONPATH": os.pathsep.join(p for p in sys.path if p)}
        silent, pipe = subprocess.DEVNULL, subprocess.PIPE
        for _ in range(self._count):
            # a session of its own, because Ctrl-C is meant for this process, which ends the helpers
            process = subprocess.Popen(
                command, stdin=pipe, stdout=pipe, stderr=silent, env=environment, start_new_session=True
            )
            self._processes.append(process)
            threading.Thread(target=_employ, args=(process, self._jobs), name="helper", daemon=True).start()

    def submit(self, function: Callable[[Item], Result], item: Item, wanted: Wanted, end: float) -> Future[Result]:
        future: Future[Any] = Future()
        self._jobs.put(_Job(future, function, item, wanted, end))
        return future

    def end(self) -> None:
        for process in self._processes:
            process.kill()
            self._jobs.put(None)
        for process in self._processes:
            process.wait()
            for stream in (process.stdin, process.stdout):
                with suppress(OSError):  # a part of an item was not read
                    stream.close()  # type: ignore[union-attr]


_HELPERS: ContextVar[_Helpers | None] = ContextVar("helpers of this diagnosis", default=None)
"""Helpers of the diagnosis that runs in this context."""


@contextmanager
def using_cores(most: int | None = None) -> Iterator[None]:
    """Loops of `on_cores` in this context may use several cores, after `start_helpers`.

    Parameters
    ----------
    most : int, optional
        Largest number of cores; all that this process may use by default.
    """
    helpers = _Helpers(min(MOST, _usable() if most is None else most) - 1)
    before = _HELPERS.set(helpers)
    try:
        yield
    finally:
        _HELPERS.reset(before)
        helpers.end()


def start_helpers() -> None:
    """Start the helpers of this context without waiting for them; they take part as soon as they have started."""
    helpers = _HELPERS.get()
    if helpers is not None:
        helpers.start()


def on_cores(
    function: Callable[[Item], Result], items: Sequence[Item], wanted: Callable[[Item], bool] = lambda item: True
) -> Iterator[tuple[Item, Result]]:
    """Every wanted item with its result, in order.

    Equal to ``((x, function(x)) for x in items if wanted(x))``. Helpers may compute later items before they are known
    to be wanted.

    Parameters
    ----------
    function : callable
        A function of a module, or a `functools.partial` of one, so that helpers find it. It has no side effects.
    items : sequence
        Its arguments.
    wanted : callable
        Whether an item is still computed, given the results so far; what is no longer wanted never becomes so again.
    """
    helpers = _HELPERS.get()
    if helpers is None or not helpers.are_started:
        yield from ((item, function(item)) for item in items if wanted(item))
        return
    end = end_of_search()
    own: Future[Any] = Future()  # the first item decides what else is wanted, so it never waits for a helper
    own.cancel()
    jobs = [own, *(helpers.submit(function, item, wanted, end) for item in items[1:])]
    try:
        for k, item in enumerate(items):
            if not wanted(item):
                jobs[k].cancel()
                continue
            while not (jobs[k].done() or jobs[k].cancel()):
                ahead = next((j for j in range(k + 1, len(items)) if wanted(items[j]) and jobs[j].cancel()), None)
                if ahead is None:
                    break
                jobs[ahead] = _computed(function, items[ahead])
            yield item, _result(jobs[k], function, item)
    finally:
        for job in jobs:
            job.cancel()


def _usable() -> int:
    """Number of cores that this process may use, counted as `os.process_cpu_count` of Python 3.13 does."""
    wanted = os.environ.get("PYTHON_CPU_COUNT", "")
    if wanted.isdecimal():
        return int(wanted)
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _computed(function: Callable[[Item], Result], item: Item) -> Future[Result]:
    future: Future[Result] = Future()
    try:
        future.set_result(function(item))
    except Exception as error:  # raised when it is the turn of the item
        future.set_exception(error)
    return future


def _result(job: Future[Result], function: Callable[[Item], Result], item: Item) -> Result:
    if not job.cancelled():
        with suppress(Exception):
            return job.result()
    return function(item)  # raises what the helper may have raised


@dataclass(frozen=True, slots=True)
class _Job:
    """An item for a helper, the time at which its computation ends, and the future of its result."""

    future: Future[Any]
    function: Callable[[Any], Any]
    item: Any
    wanted: Wanted
    end: float


def _employ(process: subprocess.Popen[bytes], jobs: SimpleQueue[_Job | None]) -> None:
    """Let a helper process compute one job after another, until it is None."""
    process.stdout.read(len(_READY))  # type: ignore[union-attr]
    while (job := jobs.get()) is not None:
        if job.future.set_running_or_notify_cancel():
            try:
                job.future.set_result(_by_helper(process, job))
            except Exception as error:  # the item is computed again where its result is wanted
                job.future.set_exception(error)


def _by_helper(process: subprocess.Popen[bytes], job: _Job) -> Any:
    """Send an item to a helper process and wait for its result."""
    if not job.wanted(job.item):
        raise CancelledError
    _send(process.stdin, (job.function, job.item, job.end))  # type: ignore[arg-type]
    is_computed, result = pickle.loads(pickle.load(process.stdout))  # type: ignore[arg-type]
    if not is_computed:
        raise CancelledError
    return result


_READY = b"ready"
"""What a helper sends when it has started."""


def _send(stream: BinaryIO, content: object) -> None:
    """Pickled twice, so that content that cannot be pickled or read back leaves the stream intact."""
    pickle.dump(pickle.dumps(content), stream)
    stream.flush()


@on_one_core
def serve() -> None:
    """Compute items until the process that sends them ends: what a helper process runs."""
    results = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # prints do not mix with results
    received: SimpleQueue[bytes] = SimpleQueue()
    threading.Thread(target=_receive, args=(received,), daemon=True).start()
    results.write(_READY)
    results.flush()
    with np.errstate(all="ignore"):
        while True:
            try:
                function, item, end = pickle.loads(received.get())
                with ending_at(end):
                    answer = pickle.dumps((True, function(item)))
            except Exception:  # the sender computes the item again, and meets the error itself
                answer = pickle.dumps((False, None))
            pickle.dump(answer, results)
            results.flush()


def _receive(received: SimpleQueue[bytes]) -> None:
    """Take items while others are computed, in order to notice at once that the sender has ended."""
    with suppress(Exception):
        while True:
            received.put(pickle.load(sys.stdin.buffer))
    os._exit(0)
