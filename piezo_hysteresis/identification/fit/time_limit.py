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

"""Time limit of a search: fits check it before they begin, and the search keeps its result so far."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar

_END: ContextVar[float] = ContextVar("end of the search", default=float("inf"))
"""Time at which the search of this context has to end, on the clock of `time.monotonic` [s]."""


class TimeSpentError(Exception):
    """The time limit of the search has passed; who set it continues with the result so far."""


@contextmanager
def ending_at(end: float) -> Iterator[None]:
    """Fits in this context raise `TimeSpentError` after a time.

    Parameters
    ----------
    end : float
        Time on the clock of `time.monotonic` [s]; infinite for no limit.
    """
    before = _END.set(end)
    try:
        yield
    finally:
        _END.reset(before)


def end_of_search() -> float:
    """Time at which the search of this context has to end, on the clock of `time.monotonic` [s]."""
    return _END.get()


def check_time() -> None:
    """Check the time limit of the search.

    Raises
    ------
    TimeSpentError
        If it has passed.
    """
    if time.monotonic() > _END.get():
        raise TimeSpentError
