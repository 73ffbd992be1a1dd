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

"""A time limit for work in a thread. First the work is interrupted; if it does not end, the process is ended."""

from __future__ import annotations

import ctypes
import os
import threading
from collections.abc import Callable
from typing import TypeVar

GRACE = 60.0
"""Time between the interruption and the end of the process [s]; a library that runs must return to Python within it."""

Result = TypeVar("Result")


class RecordingTimeSpent(BaseException):
    """The time limit of a recording has passed. It is not an `Exception`, so that error handlers do not catch it."""


def run_within(limit: float, work: Callable[[], Result], end_process: Callable[[], None] | None = None) -> Result:
    """Do work in this thread, and raise `RecordingTimeSpent` in it after a time.

    Parameters
    ----------
    limit : float
        Time [s]; infinite for no limit.
    work : callable
        Called without arguments.
    end_process : callable, optional
        Called from another thread if this one has not returned `GRACE` later. By default it ends the process at once,
        so that the scheduler detects the loss of the worker.

    Returns
    -------
    object
        What `work` returns.
    """
    if limit == float("inf"):
        return work()
    end = end_process or (lambda: os._exit(1))
    thread, lock, over, gone = threading.get_ident(), threading.Lock(), False, threading.Event()

    def watch() -> None:
        if gone.wait(limit):
            return
        with lock:
            if not over:
                _raise_in(thread, RecordingTimeSpent)
        if not gone.wait(GRACE):
            end()

    def stop_watching() -> None:
        nonlocal over
        with lock:
            over = True
            _raise_in(thread, None)  # a pending exception must not reach later code
        gone.set()

    watcher = threading.Thread(target=watch, daemon=True, name="time limit")
    try:
        watcher.start()
        return work()
    finally:
        try:
            stop_watching()
        except RecordingTimeSpent:  # the limit has passed here; it passes once
            stop_watching()


def _raise_in(thread: int, error: type[BaseException] | None) -> None:
    kind = None if error is None else ctypes.py_object(error)
    ctypes.pythonapi.PyThreadState_SetAsyncExc(ctypes.c_ulong(thread), kind)
