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

"""A wait counts the time in which messages can arrive, and no other."""

import pytest

from piezo_hysteresis.nodes.identification import wait_limit


@pytest.fixture
def clock(monkeypatch):
    """A clock that the test moves."""
    now = [100.0]
    monkeypatch.setattr(wait_limit.time, "monotonic", lambda: now[0])
    return now


def test_a_wait_passes_after_its_time(clock):
    wait = wait_limit.WaitLimit(5.0)
    checks = 0
    while not wait.has_passed():
        clock[0] += 0.02
        checks += 1
    assert checks * 0.02 == pytest.approx(5.0, abs=0.05)


def test_a_suspended_process_has_not_waited(clock):
    wait = wait_limit.WaitLimit(5.0)
    clock[0] += 3600.0
    assert not wait.has_passed()
