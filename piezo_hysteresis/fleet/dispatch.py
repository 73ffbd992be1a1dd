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

"""Sends recordings to workers, several at once, and collects their rows; repeats a recording if its worker ended."""

from __future__ import annotations

import queue
import time
import uuid
from collections import Counter, deque
from collections.abc import Iterator, Sequence
from typing import Any

from ..errors import PiezoError, RecordingError, printable
from .attempt import LATE, Order, Row, attempt, lost
from .cluster import revive

AHEAD = 4
"""Number of recordings that are submitted at once, per thread of the workers."""
TOGETHER, ALONE = 2, 2
"""Numbers of lost workers after which a recording fails. The first attempts run beside other recordings, one of which
may be the cause; the last attempts run alone."""
WAIT, COLLECT, LOOK = 0.5, 2.0, 5.0
"""Longest wait for the end of a recording, and times between two collections of rows and two checks of the workers [s].

Every submission and every collection needs messages between three processes, for one recording as for many.
"""


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
        self._running: dict[Any, int] = {}
        self._over: dict[Any, int] = {}
        self._ended: queue.SimpleQueue[Any] = queue.SimpleQueue()
        self._collected = time.monotonic()

    @property
    def is_over(self) -> bool:
        """Whether every recording has its row."""
        return not (self._waiting or self._suspects or self._running or self._over)

    def submit(self, capacity: int) -> None:
        """If at most half of `capacity` recordings are running, submit others until `capacity` are running.

        A recording that lost `TOGETHER` workers is submitted when all others are done, alone.
        """
        if self._waiting and 2 * len(self._running) <= capacity:
            free = min(capacity - len(self._running), len(self._waiting))
            self._submit([self._waiting.popleft() for _ in range(free)])
        elif self._suspects and not (self._waiting or self._running or self._over):
            self._submit([self._suspects.popleft()])

    def rows(self) -> list[Row]:
        """The rows of the recordings that have ended since the last collection.

        It waits up to `WAIT`. The list is empty if the last collection is less than `COLLECT` ago.
        """
        self._wait()
        if not self._over or (self._running and time.monotonic() - self._collected < COLLECT):
            return []
        self._collected = time.monotonic()
        # Dask computes the results of a lost worker again; if that fails, there is no row yet
        finished = {number: future for future, number in self._over.items() if future.status == "finished"}
        found: dict[int, Row | None] = self._client.gather(finished, errors="skip")
        over, self._over = self._over, {}
        rows = []
        for future, number in over.items():
            row = found.get(number)
            if row is not None:
                rows.append(row)
            elif future.status == "error":
                rows += self._failed(number, future)
            else:
                self._watch(future, number)
        return rows

    def _wait(self) -> None:
        """Wait until a running recording ends, and note which have ended."""
        if not self._running:
            return
        try:
            ended = [self._ended.get(timeout=WAIT)]
        except queue.Empty:
            return
        while not self._ended.empty():
            ended.append(self._ended.get())
        self._over |= {future: self._running.pop(future) for future in ended}

    def check(self) -> None:
        """Check the connection to the scheduler.

        Raises
        ------
        RecordingError
            If it was lost.
        """
        for future, number in self._running.items():
            if future.status == "cancelled":
                raise RecordingError(
                    f"{self._orders[number].source.url}: the scheduler was lost; repeat the same command, it continues "
                    "from here"
                )

    def _submit(self, numbers: Sequence[int]) -> None:
        orders = [self._orders[number] for number in numbers]
        keys = [(self._name, number, self._deaths[number]) for number in numbers]
        for number, future in zip(numbers, self._client.map(attempt, orders, key=keys, pure=False), strict=True):
            self._watch(future, number)

    def _watch(self, future: Any, number: int) -> None:
        self._running[future] = number
        future.add_done_callback(self._ended.put)

    def _failed(self, number: int, future: Any) -> list[Row]:
        error = future.exception()
        if isinstance(error, PiezoError):
            raise error
        if type(error).__name__ != "KilledWorker":
            reason = printable(" ".join(str(error).split())) or type(error).__name__
            raise RecordingError(f"{self._orders[number].source.url}: {reason}; see the log of the workers")
        is_late = any(key == str(future.key) for _, key in self._client.get_events(LATE))
        self._deaths[number] += 1
        if is_late or self._deaths[number] >= TOGETHER + ALONE:
            return [lost(self._orders[number], is_late)]
        (self._waiting if self._deaths[number] < TOGETHER else self._suspects).append(number)
        return []


def finished(orders: Sequence[Order], client: Any) -> Iterator[list[Row]]:
    """Process recordings on the workers of a client.

    Parameters
    ----------
    orders : sequence of Order
    client : distributed.Client
        Client from `cluster`.

    Yields
    ------
    list of dict
        Rows of the recordings that have finished; the list may be empty.

    Raises
    ------
    PiezoError
        If a worker runs other code, or the scheduler was lost.
    """
    dispatch = Dispatch(orders, client)
    looked, capacity = -LOOK, 0
    while not dispatch.is_over:
        if time.monotonic() - looked > LOOK:
            dispatch.check()
            revive(client)
            looked, capacity = time.monotonic(), AHEAD * max(1, sum(client.nthreads().values()))
        dispatch.submit(capacity)
        yield dispatch.rows()
