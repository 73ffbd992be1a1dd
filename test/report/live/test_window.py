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

"""What the page keeps and draws of a stream: no extreme is lost, no gap is hidden, predictions meet their samples."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from piezo_hysteresis.report.live.points import extremes, followed, loop_places, newest_cycles, with_gaps
from piezo_hysteresis.report.live.sample_window import SampleWindow, Window

PERIOD = 1e-3


def add(window: SampleWindow, first: int, size: int, *, predicted: bool = True) -> None:
    """A block whose values are its running numbers."""
    place = np.arange(first, first + size)
    index = (place % 2**32).astype(np.uint32)
    window.add(index, PERIOD * place, 1.0 * place, 2.0 * place)
    if predicted:
        window.add_prediction(index, 3.0 * place)


@given(st.lists(st.integers(2, 40), min_size=1, max_size=12), st.integers(-60, 60))
def test_the_newest_samples_come_back_in_order_across_the_wrap_of_the_index(sizes, start):
    window, first = SampleWindow(64), 2**32 + start
    for size in sizes:
        add(window, first, size)
        first += size
    held = min(64, sum(sizes))
    newest = window.newest(64 * PERIOD)
    expected = np.arange(first - held, first)
    np.testing.assert_array_equal(newest.voltage, expected)
    np.testing.assert_array_equal(newest.displacement, 2.0 * expected)
    np.testing.assert_array_equal(newest.prediction, 3.0 * expected)


def test_lost_samples_are_a_gap_and_a_restart_clears_the_window():
    window = SampleWindow(64)
    add(window, 100, 10)
    add(window, 115, 10, predicted=False)
    newest = window.newest(1.0)
    assert newest.size == 25
    np.testing.assert_array_equal(np.flatnonzero(np.isnan(newest.voltage)), np.arange(10, 15))
    assert np.isnan(newest.prediction[15:]).all()
    add(window, 0, 5)
    np.testing.assert_array_equal(window.newest(1.0).voltage, np.arange(5))


def test_predictions_that_come_before_their_samples_wait_for_them():
    window = SampleWindow(64)
    add(window, 100, 10)
    window.add_prediction(np.arange(110, 120, dtype=np.uint32), 3.0 * np.arange(110, 120))
    add(window, 110, 10, predicted=False)
    np.testing.assert_array_equal(window.newest(1.0).prediction, 3.0 * np.arange(100, 120))


def test_late_and_unknown_predictions_change_nothing():
    window = SampleWindow(64)
    add(window, 100, 10, predicted=False)
    window.add_prediction(np.arange(200, 205, dtype=np.uint32), np.ones(5))
    window.add_prediction(np.arange(5, dtype=np.uint32), np.ones(5))
    assert np.isnan(window.newest(1.0).prediction).all()


@pytest.mark.parametrize("size", [10, 5_000, 500_000])
def test_extremes_survive_thinning(size):
    values = np.random.default_rng(size).normal(size=size)
    values[size // 3], values[size // 2] = 50.0, -50.0
    places = extremes(values)
    assert {size // 3, size // 2} <= set(places)
    assert places.size <= 1300


def test_a_line_is_broken_where_samples_are_missing():
    values = np.sin(np.arange(50_000) / 300.0)
    values[20_000:20_500] = np.nan
    places = extremes(values)
    assert {19_999, 20_500} <= set(places)
    at, drawn = with_gaps(places, np.isfinite(values), np.arange(50_000.0), values)
    (gap,) = np.flatnonzero(np.isnan(drawn))
    assert (at[gap - 1], at[gap + 1]) == (19_999, 20_500)


def test_a_line_is_broken_where_the_driver_stalled():
    time = PERIOD * np.arange(1000.0)
    time[400:] += 0.6
    after = followed(time, 0.01)
    assert np.flatnonzero(~after) == [399]
    _, drawn = with_gaps(np.arange(1000), after, time, np.ones(1000))
    assert np.flatnonzero(np.isnan(drawn)) == [400]


@pytest.mark.parametrize("frequency", [1.0, 20.0, 400.0])
def test_a_loop_is_drawn_from_the_newest_cycles_whatever_their_number(frequency):
    time = 2e-5 * np.arange(500_000)
    drive = 5.0 - 5.0 * np.cos(2 * np.pi * frequency * time)
    window = Window(time, drive, 1e-7 * drive, 1e-7 * drive, 2e-5)
    cycles = newest_cycles(window)
    shown = float(cycles.time[-1] - cycles.time[0]) * frequency
    assert 3.0 < shown < 6.0 or cycles.size == window.size
    places = loop_places(cycles)
    assert cycles.voltage[places].max() == cycles.voltage.max()
    assert 100 < places.size < 2500
