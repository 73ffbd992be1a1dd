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

"""A time limit for work in a thread: first the work is broken off, and if it does not end, its process."""

from __future__ import annotations

import ctypes
import os
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

GRACE = 60.0
"""Time that a library may take to come back to Python after the limit, before the process ends [s]."""


class RecordingTimeSpent(BaseException):
    """The time for a recording is over; no `Exception`, so that nothing that handles errors takes it for one."""


@contextmanager
def within(limit: float, end_process: Callable[[], None] | None = None) -> Iterator[None]:
    """Raise `RecordingTimeSpent` in this thread, wherever it is, when the time is over.

    Parameters
    ----------
    limit : float
        Time [s]; infinite for none.
    end_process : callable, optional
        Called from another thread if this one has not come back `GRACE` later; default ends the process at once, so
        that a scheduler sees a dead worker.
    """
    if limit == float("inf"):
        yield
        return
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

    watcher = threading.Thread(target=watch, daemon=True, name="time limit")
    try:
        watcher.start()
        yield
    finally:
        gone.set()
        with lock:
            over = True
            _raise_in(thread, None)  # one that is on its way must not hit whatever runs here next


def _raise_in(thread: int, error: type[BaseException] | None) -> None:
    kind = None if error is None else ctypes.py_object(error)
    ctypes.pythonapi.PyThreadState_SetAsyncExc(ctypes.c_ulong(thread), kind)
