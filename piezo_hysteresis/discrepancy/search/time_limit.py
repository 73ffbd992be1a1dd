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

"""The time that a search for effects may take: refits ask before they begin, and the search keeps what it has."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar

_END: ContextVar[float] = ContextVar("end of the search", default=float("inf"))
"""Time at which the search of this context has to end, on the clock of `time.monotonic` [s]."""


class TimeSpentError(Exception):
    """The time of the search is over; `select` ends with what it has found so far."""


@contextmanager
def ending_at(end: float) -> Iterator[None]:
    """Let refits inside raise `TimeSpentError` from a time on.

    Parameters
    ----------
    end : float
        On the clock of `time.monotonic` [s]; infinite for no limit.
    """
    before = _END.set(end)
    try:
        yield
    finally:
        _END.reset(before)


def check_time() -> None:
    """Go on, or end the search.

    Raises
    ------
    TimeSpentError
        When its time is over.
    """
    if time.monotonic() > _END.get():
        raise TimeSpentError
