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

"""Recordings go to the workers several at once, and a row that was lost with its worker is waited for."""

from __future__ import annotations

import pytest

from piezo_hysteresis.errors import RecordingError
from piezo_hysteresis.fleet import dispatch
from piezo_hysteresis.fleet.attempt import Order
from piezo_hysteresis.fleet.dispatch import Dispatch
from piezo_hysteresis.fleet.source import Source
from piezo_hysteresis.fleet.storage import Storage
from piezo_hysteresis.fleet.work import Identify

ROOM = 8


class Promise:
    """Stands for a future of Dask, with the states that Dask gives it."""

    def __init__(self, row):
        self.status, self.row, self.callbacks = "pending", row, []

    def add_done_callback(self, callback):
        self.callbacks.append(callback)

    def end(self, status="finished"):
        self.status = status
        callbacks, self.callbacks = self.callbacks, []
        for callback in callbacks:
            callback(self)


class Workers:
    """Stands for a client: counts its messages, and ends a task when the test says so."""

    def __init__(self):
        self.submissions, self.gathered, self.tasks = [], 0, []

    def map(self, function, orders, key, pure):
        tasks = [Promise({"recording": order.source.url}) for order in orders]
        self.submissions.append(len(tasks))
        self.tasks += tasks
        return tasks

    def gather(self, futures, errors):
        self.gathered += 1
        return {number: future.row for number, future in futures.items() if future.status == "finished"}


def orders(count):
    places = [Source(f"/lab/{i}.npz", (f"/lab/{i}.npz",), "", Storage(), "a", None, "") for i in range(count)]
    return [Order(place, Identify(), {}, "s", "c") for place in places]


@pytest.fixture
def at_once(monkeypatch):
    monkeypatch.setattr(dispatch, "COLLECT", 0.0)
    monkeypatch.setattr(dispatch, "WAIT", 0.01)


def test_messages_are_fewer_than_recordings():
    workers = Workers()
    run, rows = Dispatch(orders(32), workers), []
    while not run.is_over:
        run.submit(ROOM)
        next(task for task in workers.tasks if task.status == "pending").end()
        rows += run.rows()
    assert sorted(row["recording"] for row in rows) == sorted(f"/lab/{i}.npz" for i in range(32))
    assert max(workers.submissions) == ROOM
    assert len(workers.submissions) <= 1 + 24 // (ROOM // 2)
    assert workers.gathered <= 2  # the test lasts less than COLLECT


def test_a_row_lost_with_its_worker_is_waited_for(at_once):
    workers = Workers()
    run = Dispatch(orders(2), workers)
    run.submit(ROOM)
    first, second = workers.tasks
    first.end()
    first.status = "lost"  # its worker was killed before the row was collected; Dask computes it again
    assert run.rows() == []
    run.check()
    second.end()
    assert [row["recording"] for row in run.rows()] == ["/lab/1.npz"]
    first.end()
    assert [row["recording"] for row in run.rows()] == ["/lab/0.npz"]
    assert run.is_over


def test_a_lost_scheduler_ends_the_run(at_once):
    workers = Workers()
    run = Dispatch(orders(2), workers)
    run.submit(ROOM)
    for task in workers.tasks:
        task.end("cancelled")
    run.rows()
    with pytest.raises(RecordingError, match="the scheduler was lost"):
        run.check()
