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

"""Work ends at its limit, wherever it is, and nothing that comes after it is hit."""

from __future__ import annotations

import sys
import threading
import time
from functools import partial

import pytest

from piezo_hysteresis.fleet import time_limit
from piezo_hysteresis.fleet.time_limit import RecordingTimeSpent, run_within


def test_work_that_catches_every_error_is_broken_off():
    def stubborn():
        while True:
            try:
                time.sleep(0.001)
            except Exception:
                continue

    with pytest.raises(RecordingTimeSpent):
        run_within(0.05, stubborn)


@pytest.mark.parametrize("limit", [60.0, float("inf")])
def test_work_within_the_limit_is_left_alone(limit):
    assert run_within(limit, partial(sum, range(1000))) == 499500


def busy(seconds):
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        pass


@pytest.fixture
def threads_that_alternate_often():
    before = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    yield
    sys.setswitchinterval(before)


@pytest.mark.usefixtures("threads_that_alternate_often")
def test_a_late_time_limit_does_not_affect_later_work():
    """The limit falls close to the end of the work, before or after it; afterwards nothing watches the thread."""
    spent = 0
    for step in range(1000):
        try:
            run_within(2e-3, partial(busy, 1.9e-3 + 4e-7 * step))
        except RecordingTimeSpent:
            spent += 1
        for _ in range(200):
            pass
    assert 0 <= spent <= 1000
    late = [thread for thread in threading.enumerate() if thread.name == "time limit"]
    for thread in late:
        thread.join(10.0)
    assert not [thread for thread in late if thread.is_alive()]


def test_a_library_that_does_not_come_back_costs_the_process(monkeypatch):
    monkeypatch.setattr(time_limit, "GRACE", 0.05)
    ended = threading.Event()
    with pytest.raises(RecordingTimeSpent):
        run_within(0.02, lambda: threading.Event().wait(0.5), ended.set)  # one call that runs on
    assert ended.is_set()
