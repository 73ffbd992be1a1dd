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

"""Records are brought to the period and length that the search needs, and keep what their drive shows."""

import numpy as np
import pytest
import scipy
from hypothesis import given
from hypothesis import strategies as st

from piezo_hysteresis.identification.records.excitation_content import excitation_content
from piezo_hysteresis.identification.records.sampling import (
    at_period,
    common_period,
    shortened,
    slowed,
)
from piezo_hysteresis.record import Record

FAST = 2e-5
RANDOM = np.random.default_rng(5)


def sine(frequency, period, duration, **options):
    t = period * np.arange(round(duration / period))
    return Record(
        3 + np.sin(2 * np.pi * frequency * t), 1e-6 * np.sin(2 * np.pi * frequency * t - 0.3), period, **options
    )


@given(frequency=st.floats(0.1, 1.0))
def test_a_slow_phase_recorded_fast_keeps_its_averages(frequency):
    fast = sine(frequency, FAST, 1.0)
    slow = slowed(fast)
    assert slow.size < fast.size and slow.duration == pytest.approx(fast.duration, rel=1e-3)
    assert slow.displacement.mean() == pytest.approx(fast.displacement.mean(), abs=1e-15)
    assert slow.settled_voltage == fast.settled_voltage


def test_averages_that_do_not_describe_the_drive_are_not_used():
    assert slowed(sine(200.0, FAST, 1.0)).sample_period < 1e-3 / 2
    noise = Record(RANDOM.normal(size=50_000), RANDOM.normal(size=50_000), FAST)
    assert slowed(noise) is noise


def test_averages_that_lose_the_turns_of_the_drive_are_not_used():
    """A triangle that turns at every sample for 4 % of the time: slow by its spectrum, but a loop feels every turn."""
    speed = np.repeat(np.tile((1.0, -1.0), 3), 16_000)
    shaken = np.arange(speed.size) % 1_000 < 40
    speed[shaken] *= np.where(np.arange(speed.size)[shaken] % 2, 1.0, -1.0)
    wander = np.cumsum(speed) / 16_000
    record = Record(wander, wander * 1e-6, FAST)
    assert excitation_content(record).is_slow
    assert slowed(record) is record
    assert shortened([record], 6_000)[0] is record


def test_noise_is_cut_and_a_chirp_is_not():
    noise = Record(RANDOM.normal(size=50_000), RANDOM.normal(size=50_000), FAST)
    t = FAST * np.arange(50_000)
    chirp = np.sin(2 * np.pi * 200 * t * t)
    whole = Record(chirp, chirp, FAST)
    first, second = shortened((noise, whole), 6000)
    assert first.size == 6000 and np.array_equal(first.voltage, noise.voltage[:6000])
    assert second.size == whole.size


def test_a_record_that_another_continues_is_not_cut():
    noise = Record(RANDOM.normal(size=20_000), RANDOM.normal(size=20_000), FAST)
    first, second = noise.split(10_000)
    assert [r.size for r in shortened((first, second), 6000)] == [10_000, 6000]


@pytest.mark.parametrize("factor", [5, 10])
def test_a_drive_that_excites_the_dynamics_is_interpolated_to_their_period(factor):
    slow, fast = sine(200.0, factor * FAST, 0.2), sine(200.0, FAST, 0.2)
    found = at_period(slow, FAST)
    assert found.sample_period == FAST
    inside = slice(20 * factor, found.size - 20 * factor)
    assert np.allclose(found.voltage[inside], fast.voltage[: found.size][inside], atol=1e-4)
    assert np.allclose(found.displacement[inside], fast.displacement[: found.size][inside], atol=1e-10)


def test_slow_loops_and_jumps_stay_at_their_own_period():
    loop = sine(1.0, 1e-3, 2.0)
    stairs = Record(np.repeat([0.0, 2.0, 1.0], 1000), np.zeros(3000), 1e-2)
    assert at_period(loop, FAST) is loop
    assert at_period(stairs, FAST) is stairs


def test_levels_with_steep_ramps_between_them_stay_at_their_own_period():
    """A spline swings at the ends of a ramp: creep of 1.43 % per decade had the interval 1.33 to 1.41 %."""
    levels = np.convolve(np.repeat((20.0, 60.0, 90.0, 40.0), 1500), np.full(10, 0.1), "valid")
    staircase = Record(levels, 1e-7 * levels, 2e-3)
    assert not excitation_content(staircase).is_slow
    assert at_period(staircase, 4e-4) is staircase


def lagging(levels, period, time_constant=1e-3):
    """Held levels behind a lag of first order, whose displacement is measured at the beginning of every sample."""
    share = -np.expm1(-period / time_constant)
    y = scipy.signal.lfilter([0.0, share], [1.0, share - 1.0], levels)
    return Record(levels, 1e-6 * y, period, initial_voltage=0.0)


@pytest.mark.parametrize("factor", [2, 5])
def test_a_faster_record_has_the_lag_that_it_has_at_the_period_of_the_dynamics(factor):
    """Averages over the same samples made the response earlier, by 2 of 5 samples."""
    levels = RANDOM.normal(size=400)
    found = at_period(lagging(np.repeat(levels, factor), FAST), factor * FAST)
    slow = lagging(levels, factor * FAST)
    assert found.sample_period == slow.sample_period
    assert np.allclose(found.voltage, slow.voltage)
    assert np.allclose(found.displacement, slow.displacement)


def test_a_faster_record_of_another_ratio_has_the_same_lag():
    levels = RANDOM.normal(size=400)
    found = at_period(lagging(np.repeat(levels, 5), FAST), 2.5 * FAST)
    assert np.allclose(found.voltage[::2], levels)
    assert np.allclose(found.displacement[::2], lagging(levels, 5 * FAST).displacement)


def test_broadband_records_set_the_period_of_the_dynamics():
    noise = Record(RANDOM.normal(size=4000), RANDOM.normal(size=4000), 5 * FAST)
    step = Record(np.repeat([0.0, 1.0], 1000), np.repeat([0.0, 1e-6], 1000), FAST)
    assert common_period((step, noise)) == 5 * FAST


@pytest.mark.parametrize("size", [1, 2, 3, 4])
def test_records_of_a_few_samples_are_brought_to_another_period(size):
    few = Record(np.arange(float(size)), np.arange(float(size)), 3 * FAST)
    found = at_period(few, 12 * FAST)
    assert found.sample_period == 12 * FAST and found.size == 1
    assert found.voltage[0] == pytest.approx(few.voltage.mean()) and found.displacement[0] == 0.0
