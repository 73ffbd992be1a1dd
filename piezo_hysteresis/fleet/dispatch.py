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

"""Sends recordings to workers, a few at a time, and collects their rows; repeats a recording if its worker ended."""

from __future__ import annotations

import queue
import time
import uuid
from collections import Counter, deque
from collections.abc import Iterator, Sequence
from typing import Any

from ..errors import PiezoError, RecordingError, printable
from .attempt import Order, Row, attempt, lost
from .cluster import revive

AHEAD = 4
"""Number of submitted recordings per thread."""
TOGETHER, ALONE = 2, 2
"""Numbers of lost workers after which a recording fails: while others run, which may be the cause, and alone."""
WAIT, LOOK = 0.5, 5.0
"""Longest wait for the next result, and time between two checks of the workers [s]."""


class Dispatch:
    """The recordings of one run and their state.

    Parameters
    ----------
    orders : sequence of Order
    client : distributed.Client
    """

    def __init__(self, orders: Sequence[Order], client: Any) -> None:
        self._orders, self._client = orders, client
        self._name = f"fleet-{uuid.uuid4().hex[:8]}"
        self._waiting = deque(range(len(orders)))
        self._suspects: deque[int] = deque()
        self._deaths: Counter[int] = Counter()
        self._under_way: dict[Any, int] = {}
        self._ended: queue.SimpleQueue[Any] = queue.SimpleQueue()

    @property
    def is_over(self) -> bool:
        """Whether every recording has its row."""
        return not (self._waiting or self._suspects or self._under_way)

    def submit(self, room: int) -> None:
        """Submit recordings until `room` of them are running; recordings that lost a worker run last, one by one."""
        while self._waiting and len(self._under_way) < room:
            self._submit(self._waiting.popleft())
        if self._suspects and not self._under_way:
            self._submit(self._suspects.popleft())

    def rows(self) -> list[Row]:
        """Finished rows, after a short wait for the first."""
        try:
            futures = [self._ended.get(timeout=WAIT)]
        except queue.Empty:
            return []
        while not self._ended.empty():
            futures.append(self._ended.get())
        # the results of a lost worker are computed again, which may fail; then there is no row
        finished = {self._under_way[f]: f for f in futures if f.status == "finished"}
        found: dict[int, Row | None] = self._client.gather(finished, errors="skip")
        rows = []
        for future in futures:
            row = found.get(self._under_way[future])
            if row is not None:
                rows.append(row)
            elif future.status == "error":
                rows += self._failed(future)
            else:
                future.add_done_callback(self._ended.put)
                continue
            del self._under_way[future]
        return rows

    def check(self) -> None:
        """Check the connection to the scheduler.

        Raises
        ------
        RecordingError
            If it was lost.
        """
        for future, number in self._under_way.items():
            if future.status in ("cancelled", "lost"):
                raise RecordingError(
                    f"{self._orders[number].source.url}: the scheduler was lost; repeat the same command, it continues "
                    "from here"
                )

    def _submit(self, number: int) -> None:
        key = (self._name, number, self._deaths[number])
        future = self._client.submit(attempt, self._orders[number], key=key, pure=False)
        self._under_way[future] = number
        future.add_done_callback(self._ended.put)

    def _failed(self, future: Any) -> list[Row]:
        number, error = self._under_way[future], future.exception()
        if isinstance(error, PiezoError):
            raise error
        if type(error).__name__ != "KilledWorker":
            said = printable(" ".join(str(error).split())) or type(error).__name__
            raise RecordingError(f"{self._orders[number].source.url}: {said}; see the log of the workers")
        self._deaths[number] += 1
        if self._deaths[number] >= TOGETHER + ALONE:
            return [lost(self._orders[number])]
        (self._waiting if self._deaths[number] < TOGETHER else self._suspects).append(number)
        return []


def finished(orders: Sequence[Order], client: Any) -> Iterator[list[Row]]:
    """The rows of orders as they are finished, in lists; a list may be empty.

    Parameters
    ----------
    orders : sequence of Order
    client : distributed.Client
        From `cluster`.

    Raises
    ------
    PiezoError
        If a worker runs other code, or the scheduler was lost.
    """
    dispatch = Dispatch(orders, client)
    looked, room = -LOOK, 0
    while not dispatch.is_over:
        if time.monotonic() - looked > LOOK:
            dispatch.check()
            revive(client)
            looked, room = time.monotonic(), AHEAD * max(1, sum(client.nthreads().values()))
        dispatch.submit(room)
        yield dispatch.rows()
