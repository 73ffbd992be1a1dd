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

"""Streams of several drivers are joined by their times, whatever is lost, late or restarted."""

from contextlib import suppress
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from piezo_hysteresis.acquisition.sample_block import SampleBlock
from piezo_hysteresis.errors import RecordError
from piezo_hysteresis.online.axes_joiner import LARGEST_SKEW, LONGEST_WAIT, AxesJoiner

PERIOD = 1e-4
START = 1_700_000_000_000_000_000


def block(begin, first, size, begun=0.0, shift=0.0, index=None, phase=0):
    """Samples `first` on of a driver that began at `begin` periods; a displacement is its time in periods."""
    number = np.arange(first, first + size)
    at = begin + number
    return SampleBlock(
        START + round((begun + (begin + first) * PERIOD + shift) * 1e9),
        PERIOD * np.arange(size),
        np.zeros(size),
        1e-6 * at,
        (number if index is None else index + np.arange(size)).astype(np.uint32),
        np.full(size, phase, np.uint32),
    )


def times(joined):
    """Times of the joined samples of every stream [periods], shape (n, streams)."""
    parts = [np.stack([b.displacement for b in one.blocks], axis=1) for one in joined]
    return np.round(1e6 * np.concatenate(parts), 6)


@given(
    st.lists(st.tuples(st.integers(0, 300), st.floats(-0.45, 0.45), st.integers(1, 90)), min_size=1, max_size=3),
    st.randoms(use_true_random=False),
)
def test_samples_of_the_same_time_are_joined_whenever_they_arrive(streams, random):
    joiner = AxesJoiner(len(streams), PERIOD)
    arriving = [
        [block(begin, first, size, shift=late * PERIOD) for first in range(0, 400, size)]
        for begin, late, size in streams
    ]
    joined = []
    while any(arriving):
        number = random.choice([n for n, blocks in enumerate(arriving) if blocks])
        joiner.add(number, arriving[number].pop(0))
        joined += joiner.take()
    together = times(joined)
    assert np.abs(together - together[:, :1]).max() < 1.0 + 1e-6
    assert np.allclose(np.diff(together[:, 0]), 1.0)
    begin = max(begin for begin, _, _ in streams)
    assert abs(len(together) - (min(b + -(-400 // s) * s for b, _, s in streams) - begin)) <= 1
    assert [one.restarted for one in joined] == [True] + [False] * (len(joined) - 1)
    assert joiner.lost == 0
    assert not joiner.moves
    assert joiner.joined == len(together)


def test_lost_samples_of_one_stream_are_missing_in_all():
    joiner = AxesJoiner(2, PERIOD)
    joined = []
    for first in range(0, 500, 100):
        joiner.add(0, block(0, first, 100))
        if first != 200:
            joiner.add(1, block(0, first, 100))
        joined += joiner.take()
    assert [one.missing for one in joined] == [0, 0, 100, 0]
    assert (np.diff(times(joined), axis=1) == 0).all()
    assert joiner.lost == 100


def test_repeated_and_late_blocks_are_dropped():
    joiner = AxesJoiner(2, PERIOD)
    joined = []
    for first in (0, 100, 100, 0, 200):
        for number in range(2):
            joiner.add(number, block(0, first, 100))
        joined += joiner.take()
    assert np.array_equal(times(joined)[:, 1], np.arange(300))
    assert joiner.repeated == 400


def test_a_driver_that_restarts_is_joined_again_by_its_time():
    joiner = AxesJoiner(2, PERIOD)
    joined = []
    for first in range(0, 1000, 100):
        joiner.add(0, block(0, first, 100))
        if first < 500:
            joiner.add(1, block(0, first, 100))
        elif first >= 700:  # it began 750 periods after the other, and counts from 0
            joiner.add(1, block(750, first - 700, 100))
        joined += joiner.take()
    assert np.abs(np.diff(times(joined), axis=1)).max() < 1e-6
    assert [one.restarted for one in joined].count(True) == 2
    assert joiner.joined == 500 + 200  # the block of the other that waited is dropped
    assert not joiner.moves


@pytest.mark.parametrize("shift", [0.5, 3.0])
def test_a_stamp_that_moves_counts_once_it_contradicts_the_index(shift):
    joiner = AxesJoiner(2, PERIOD)
    joined = []
    for first in range(0, 1000, 100):
        joiner.add(0, block(0, first, 100))
        joiner.add(1, block(0, first, 100, shift=shift * LARGEST_SKEW if first >= 500 else 0.0))
        joined += joiner.take()
    skew = np.diff(times(joined), axis=1)[-1, 0]
    assert skew == pytest.approx(0.0 if shift < 1.0 else -shift * LARGEST_SKEW / PERIOD, abs=1e-6)
    assert [number for number, _ in joiner.moves] == ([1] if shift > 1.0 else [])
    assert [one.restarted for one in joined].count(True) == 1 + (shift > 1.0)


@pytest.mark.parametrize("jump", [-3600.0, -0.5, 0.5])
@pytest.mark.parametrize("streams", [1, 2])
def test_a_clock_that_is_set_stops_nothing(streams, jump):
    joiner = AxesJoiner(streams, PERIOD)
    joined = []
    for first in range(0, 20_000, 100):
        for number in range(streams):
            joiner.add(number, block(0, first, 100, shift=jump if first >= 10_000 else 0.0))
        joined += joiner.take()
    together = times(joined)
    assert (together == together[:, :1]).all()
    assert len(together) == 20_000
    assert [n for n, one in enumerate(joined) if one.restarted] == ([0] if streams == 1 else [0, 100])
    assert not any(one.missing for one in joined)


def test_the_stamps_of_a_single_stream_do_not_matter():
    joiner = AxesJoiner(1, PERIOD)
    joined = []
    jitter = np.random.default_rng(1).exponential(1e-3, 1000)
    for number, late in enumerate(jitter):
        joiner.add(0, block(0, 50 * number, 50, shift=late))
        joined += joiner.take()
    assert joiner.joined == 50_000
    assert not any(one.missing for one in joined)


def test_long_blocks_are_joined_whole():
    joiner = AxesJoiner(2, PERIOD)
    size = round(1.5 * LONGEST_WAIT / PERIOD)
    joined = []
    for first in range(0, 4 * size, size):
        for number in range(2):
            joiner.add(number, block(0, first, size))
        joined += joiner.take()
    assert joiner.joined == 4 * size


def test_a_pause_of_one_stream_does_not_vouch_for_the_other():
    joiner = AxesJoiner(2, PERIOD)
    joined = []
    for first in range(0, 600, 100):
        joiner.add(0, block(0, first, 100))
        if first not in (200, 300):
            joiner.add(1, replace(block(0, first, 100), follows_gap=first == 400))
        joined += joiner.take()
    (after,) = [one for one in joined if one.missing]
    assert not after.follows_gap
    assert (np.diff(times(joined), axis=1) == 0).all()


@pytest.mark.parametrize("period", [0.01, 0.011])
def test_single_samples_of_another_period_are_refused(period):
    joiner = AxesJoiner(1, 0.01)
    jitter = 1e-4 * np.random.default_rng(1).standard_normal(300)
    singles = [
        replace(block(0, 0, 1, shift=period * number + late), index=np.array([number], np.uint32))
        for number, late in enumerate(jitter)
    ]
    for one in singles[:50]:  # half a second
        joiner.add(0, one)
    refused = []
    for one in singles[50:]:
        with suppress(RecordError):
            joiner.add(0, one)
            continue
        refused.append(one)
    assert len(refused) == 0 if period == 0.01 else len(refused) > 200


@pytest.mark.parametrize("drift", [5e-4, -5e-4, 5e-5])
def test_a_driver_that_starts_later_is_joined_behind_a_clock_that_drifts(drift):
    joiner = AxesJoiner(2, PERIOD)
    joined = []
    for first in range(0, 60_000, 100):
        for number in range(2):
            if number == 0 or first >= 30_000:
                joiner.add(number, block(0, first, 100, shift=drift * PERIOD * first))
        joined += joiner.take()
    assert (np.diff(times(joined), axis=1) == 0).all()
    assert not joiner.moves


def test_samples_of_one_stream_that_are_dropped_are_no_pause():
    joiner = AxesJoiner(2, PERIOD)
    joined = []
    for first in (0, 100, 200, 600):  # both pause from 300 to 600; the second loses the block before
        joiner.add(0, replace(block(0, first, 100), follows_gap=first == 600))
        if first != 200:
            joiner.add(1, replace(block(0, first, 100), follows_gap=first == 600))
        joined += joiner.take()
    (after,) = [one for one in joined if one.missing]
    assert after.missing == 400
    assert not after.follows_gap


def test_a_stream_whose_clock_stands_costs_no_memory():
    joiner = AxesJoiner(2, PERIOD)
    for first in range(0, 100_000, 100):
        joiner.add(1, block(0, first, 100, shift=-first * PERIOD))
    assert sum(b.size for _, b in joiner._streams[1].waiting) <= LONGEST_WAIT / PERIOD


def test_a_late_block_does_not_stop_a_bag_that_is_played_again():
    joiner = AxesJoiner(2, PERIOD)
    joined = []
    order = [(number, first) for first in range(0, 30_000, 1000) for number in range(2)]
    late = [*order[:-1], (0, 0), order[-1], *order[1:]]
    for number, first in late:
        joiner.add(number, block(0, first, 1000))
        joined += joiner.take()
    assert joiner.joined >= 58_000


def test_a_bag_that_is_played_again_begins_anew():
    joiner = AxesJoiner(2, PERIOD)
    joined = []
    for _ in range(2):
        for first in range(0, 30_000, 1000):
            for number in range(2):
                joiner.add(number, block(0, first, 1000))
            joined += joiner.take()
    assert len(joined) == 60
    assert [n for n, one in enumerate(joined) if one.restarted] == [0, 30]
    assert not any(one.missing for one in joined)


def test_a_silent_stream_costs_no_memory_and_comes_back():
    joiner = AxesJoiner(2, PERIOD)
    joined = []
    for first in range(0, 60_000, 1000):
        joiner.add(0, block(0, first, 1000))
        if not 10_000 <= first < 50_000:
            joiner.add(1, block(0, first, 1000))
        joined += joiner.take()
        assert sum(b.size for _, b in joiner._streams[0].waiting) <= LONGEST_WAIT / PERIOD
    assert (np.diff(times(joined), axis=1) == 0).all()
    assert joiner.joined == 20_000


def test_the_index_may_wrap():
    joiner = AxesJoiner(2, PERIOD)
    joined = []
    for first in range(0, 300, 100):
        joiner.add(0, block(0, first, 100, index=(2**32 - 150 + first) % 2**32))
        joiner.add(1, block(0, first, 100))
        joined += joiner.take()
    assert np.array_equal(times(joined)[:, 0], np.arange(300))


def test_another_sample_period_is_refused():
    joiner = AxesJoiner(2, 2 * PERIOD)
    with pytest.raises(RecordError, match=r"got the sample period 0\.0001 s, expected 0\.0002 s"):
        joiner.add(0, block(0, 0, 100))
