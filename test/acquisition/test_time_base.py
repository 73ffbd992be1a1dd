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

"""Index, steady clock and stamp agree; only a jump of the node's clock moves the stamps."""

from time import monotonic_ns, sleep

import pytest
from hypothesis import given
from hypothesis import strategies as st

from piezo_hysteresis.acquisition.time_base import LATEST_STAMP, TimeBase, read_together

START = 1_700_000_000_000_000_000


def base(rate=1.0, period=2e-5):
    time = TimeBase(period, rate)
    time.anchor(100, 50.0, START)
    return time


@given(st.integers(0, 2**40))
def test_stamps_count_samples_without_drift(n):
    assert base().stamp(100 + n) - START == pytest.approx(n * 20_000, abs=1 + n * 20_000 * 1e-15)


@given(st.integers(0, 10**9), st.floats(0.01, 100))
def test_index_at_inverts_due(n, rate):
    time = base(rate)
    assert abs(time.index_at(time.due(100 + n)) - (100 + n)) <= 1


def test_late_blocks_and_small_drift_need_no_correction():
    time = base()
    assert time.follow(600, 50.0 + 0.3, START + 300_000_000) == 0.0
    assert time.follow(600, 50.3, START + 300_000_000 + 900_000) == 0.0
    assert time.stamp(600) == START + 500 * 20_000


@pytest.mark.parametrize("jump", [0.002, -3600.0, 86400.0])
def test_a_jump_of_the_clock_resets_the_time_base_once(jump):
    time = base()
    moved = round(jump * 1e9)
    assert time.follow(600, 50.01, START + 10_000_000 + moved) == pytest.approx(jump)
    assert time.stamp(600) == START + 500 * 20_000 + moved
    assert time.follow(1100, 50.02, START + 20_000_000 + moved) == 0.0
    assert time.due(1100) == pytest.approx(50.02)


def test_stamps_stand_still_at_the_latest_date_of_a_message_and_go_on_when_the_clock_is_set_right():
    time = base()
    ahead = LATEST_STAMP - START + 10**9
    time.follow(600, 50.01, START + 10_000_000 + ahead)
    assert time.stamp(600) == time.stamp(10**9) == LATEST_STAMP
    assert time.follow(1100, 50.02, START + 20_000_000) == pytest.approx(-ahead * 1e-9)
    assert time.stamp(1100) == START + 20_000_000


def test_an_interrupted_reading_is_not_a_jump():
    waits = iter([0.0, 0.01, 0.01, 0.0])

    def clock():
        sleep(next(waits, 0.0))  # the processor was away, before the reading or behind it
        now = monotonic_ns() + START
        sleep(next(waits, 0.0))
        return now

    steady, node = read_together(clock)
    assert abs(node - START - round(steady * 1e9)) < 1_000_000


def test_postponing_moves_stamps_in_real_time_only():
    time, fast = base(), base(rate=10.0)
    for clock in (time, fast):
        late = clock.due(600) + 2.0
        assert clock.postpone(600, late) == pytest.approx(2.0)
        assert clock.due(600) == pytest.approx(late)
    assert time.stamp(600) == START + 10_000_000 + 2_000_000_000
    assert fast.stamp(600) == START + 10_000_000
