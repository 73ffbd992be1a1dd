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

"""What block averages hide of a drive is made good from the averages around it."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from piezo_hysteresis.effects import Arx, BoucWen, RateDependentHysteresis
from piezo_hysteresis.identification.records.intersample_error import chosen_correction, intersample_error, sharp_drive
from piezo_hysteresis.model.model import Model
from piezo_hysteresis.record import Record

PERIOD = 1e-4
STAGE = Model((BoucWen(A=0.4, beta=0.6, gamma=-0.1), Arx(a=(-0.5,), b=(0.5,), delay=1.0)), PERIOD, 10.0, 1e-5)


def triangle(shift):
    time = PERIOD * np.arange(40_000)
    return 10.0 * (1.0 - np.abs(2.0 * np.mod(time + shift, 1.0) - 1.0)) * (time >= 1.0 - shift)


def staircase(ramp):
    levels = np.array([0.0, 4.0, 9.0, 3.0, 6.0])
    time = PERIOD * np.arange(50_000)
    jumps = np.clip((time[:, None] - np.arange(1.0, 5.0) - 0.0437) / ramp, 0.0, 1.0)
    return jumps @ np.diff(levels)


def averaged(drive, factor):
    (displacement,) = STAGE.simulate([Record(drive, np.zeros(drive.size), PERIOD)])
    return Record(drive, displacement, PERIOD).decimate(factor)


@pytest.mark.parametrize(
    ("drive", "factor"),
    [(triangle(0.003), 100), (triangle(0.0061), 200), (staircase(1e-4), 1000), (staircase(0.05), 1000)],
)
def test_most_of_the_inter_sample_error_is_corrected(drive, factor):
    slow = averaged(drive, factor)
    (change,), (point,) = intersample_error(STAGE, [slow]), STAGE.simulate([slow])
    missed = np.std(slow.displacement - point)
    assert missed > 2e-4 * np.ptp(slow.displacement)
    assert np.std(slow.displacement - point - change) < 0.4 * missed


RATE_DEPENDENT = STAGE.with_effect(RateDependentHysteresis(k=0.05, a=0.3, jumps=0.0))


@pytest.mark.parametrize(("drive", "factor"), [(triangle(0.0061), 10), (staircase(0.05), 100), (staircase(0.1), 100)])
def test_ramps_keep_their_speed_where_the_loop_depends_on_it(drive, factor):
    """The average over the end of a ramp moves less than the ramp in the same time, and would seem slower."""
    (displacement,) = RATE_DEPENDENT.simulate([Record(drive, np.zeros(drive.size), PERIOD)])
    slow = Record(drive, displacement, PERIOD).decimate(factor)
    (change,), (point,) = intersample_error(RATE_DEPENDENT, [slow]), RATE_DEPENDENT.simulate([slow])
    missed = slow.displacement - point
    assert np.std(missed - change) < 0.4 * np.std(missed)


def test_a_smooth_drive_needs_no_correction_even_with_slow_dynamics():
    time = PERIOD * np.arange(20_000)
    drive = 5.0 * (1.0 - np.cos(2.0 * np.pi * 10.0 * time))
    slow = averaged(drive, 10)
    wrong = STAGE.with_effect(Arx(a=(-0.995,), b=(0.005,), delay=1.0))
    (change,) = intersample_error(wrong, [slow])
    assert not change.any()


RINGING = STAGE.with_effect(Arx(a=(-1.9, 0.95), b=(0.05,), delay=1.0))
"""A mode at 360 Hz with a damping ratio of 0.11."""


@pytest.mark.parametrize("factor", [2, 4, 10])
@pytest.mark.parametrize("noise", [0.0, 5e-4])
def test_ringing_after_a_kink_is_corrected(factor, noise):
    time = PERIOD * np.arange(8000)
    drive = 10.0 * (1.0 - np.abs(2.0 * np.mod(8.0 * time, 1.0) - 1.0))
    (displacement,) = RINGING.simulate([Record(drive, np.zeros(drive.size), PERIOD)])
    displacement += noise * np.ptp(displacement) * np.random.default_rng(1).normal(size=displacement.size)
    slow = Record(drive, displacement, PERIOD).decimate(factor)
    (change,), (point,) = intersample_error(RINGING, [slow]), RINGING.simulate([slow])
    floor = noise * np.ptp(displacement) / np.sqrt(factor)
    missed = np.sqrt(max(np.var(slow.displacement - point) - floor**2, 0.0))
    left = np.sqrt(max(np.var(slow.displacement - point - change) - floor**2, 0.0))
    assert missed > 1e-3 * np.ptp(slow.displacement)
    assert left < 0.4 * missed


def test_no_correction_is_made_that_the_residual_does_not_contain():
    time = PERIOD * np.arange(8000)
    drive = 10.0 * (1.0 - np.abs(2.0 * np.mod(8.0 * time, 1.0) - 1.0))
    (displacement,) = STAGE.simulate([Record(drive, np.zeros(drive.size), PERIOD)])
    slow = Record(drive, displacement, PERIOD).decimate(4)
    assert np.std(intersample_error(RINGING, [slow])[0]) < 1e-4 * np.ptp(displacement)


def test_a_slow_relaxation_is_not_mistaken_for_an_inter_sample_error():
    """A fit that lacks creep gives G such a pole beside a zero; slow records do not hold what it says."""
    time = PERIOD * np.arange(40_000)
    drive = 10.0 * (1.0 - np.abs(2.0 * np.mod(time, 1.0) - 1.0))
    slow = averaged(drive, 10)
    pole, zero = np.exp(-2.0 * np.pi * 3.0 * PERIOD), np.exp(-2.0 * np.pi * 3.06 * PERIOD)
    a, b = np.convolve((1.0, -0.5), (1.0, -pole)), np.convolve((0.5,), (1.0, -zero)) * (1.0 - pole) / (1.0 - zero)
    creeping = STAGE.with_effect(Arx(a=tuple(a[1:]), b=tuple(b), delay=1.0))
    (change,), (known,) = intersample_error(creeping, [slow]), intersample_error(STAGE, [slow])
    assert np.std(change - known) < 1e-5 * np.ptp(slow.displacement)


def test_records_that_are_not_slow_are_not_changed():
    drive = np.random.default_rng(0).normal(size=500)
    record = Record(drive, 1e-6 * drive, PERIOD)
    assert not intersample_error(STAGE, [record])[0].any()


SAMPLES = np.arange(1000)
NOISE = 0.05 * np.random.default_rng(3).normal(size=SAMPLES.size)
LEVELS = 1.0 * (SAMPLES % 100 == 0)
"""Single samples in which the drive goes to its next level."""
SLOW = np.sin(2.0 * np.pi * SAMPLES / 700.0)
"""A change over many samples, as a loop keeps it or as wrong dynamics leave it."""


def is_chosen(correction, residual, gradual, abrupt):
    return np.array_equal(chosen_correction(residual, gradual, abrupt), correction)


@pytest.mark.parametrize("slow", [0.0, 3.0])
def test_the_correction_that_the_displacement_contains_is_chosen_also_beside_a_slow_misfit(slow):
    gradual, abrupt = LEVELS, np.roll(LEVELS, 1)
    misfit = slow * SLOW + NOISE
    assert is_chosen(gradual, gradual + misfit, gradual, abrupt)
    assert is_chosen(abrupt, abrupt + misfit, gradual, abrupt)


def test_of_two_corrections_that_are_almost_equally_smooth_the_smaller_residual_decides():
    gradual, abrupt = 0.95 * LEVELS + 0.2 * SLOW, LEVELS
    assert is_chosen(gradual, LEVELS + 0.2 * SLOW + NOISE, gradual, abrupt)


def test_a_correction_that_is_wrong_in_single_samples_is_not_chosen_because_it_reduces_a_slow_misfit():
    gradual, abrupt = np.roll(LEVELS, 1) + 0.3 * SLOW, LEVELS
    assert is_chosen(abrupt, LEVELS + 3.0 * SLOW + NOISE, gradual, abrupt)


def test_no_correction_is_chosen_if_the_residual_contains_neither():
    assert not chosen_correction(SLOW + NOISE, LEVELS, np.roll(LEVELS, 1)).any()


@given(
    arrays(np.float64, st.integers(1, 30), elements=st.floats(-10.0, 10.0, allow_subnormal=False)),
    st.sampled_from([2, 4, 10, 16]),
    st.booleans(),
)
def test_averages_are_kept(averages, parts, abrupt):
    drive = sharp_drive(averages, float(averages[0]), parts, abrupt=abrupt)
    assert drive.size == parts * averages.size
    np.testing.assert_allclose(drive.reshape(-1, parts).mean(axis=1), averages, atol=1e-9)
