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

"""What a drive excites: neither a jump nor the noise of its recorder makes a slow drive a broadband one."""

import numpy as np
import pytest

from benchmarks.nanopositioner import growing_sine
from piezo_hysteresis.identification.records.excitation_content import excitation_content
from piezo_hysteresis.identification.records.roles import roles_of
from piezo_hysteresis.record import Experiment, Record


def content(voltage, period, **options):
    return excitation_content(Record(voltage, 1e-6 * voltage, period, **options))


@pytest.fixture
def random():
    return np.random.default_rng(0)


def triangle(frequency, duration, period):
    return 10.0 * np.abs(np.mod(frequency * period * np.arange(round(duration / period)) + 0.5, 1.0) * 2.0 - 1.0)


@pytest.mark.parametrize("period", [1e-2, 5e-3, 1e-3, 2e-5])
def test_a_jump_in_a_slow_drive_is_not_broadband(period):
    time = period * np.arange(round(30.0 / period) if period > 1e-4 else 100_000)
    voltage = 1.8 + 1.8 * np.sin(2 * np.pi * time)
    voltage[0] = 0.0
    assert not content(voltage, period).is_broadband


@pytest.mark.parametrize("noise", [1e-5, 1e-4, 3e-4])
def test_a_measured_drive_keeps_its_bandwidth(random, noise):
    clean = triangle(1.0, 4.0, 2e-5)
    measured = clean + noise * 10.0 * random.standard_normal(clean.size)
    assert not content(measured, 2e-5).is_broadband
    assert content(measured, 2e-5).bandwidth == pytest.approx(content(clean, 2e-5).bandwidth, abs=2.0)


@pytest.mark.parametrize("cycles", [1, 2, 5])
@pytest.mark.parametrize("triangle", [False, True], ids=["sines", "triangles"])
def test_growing_waves_of_three_rates_in_one_record_are_not_broadband(cycles, triangle):
    period = 1e-4
    parts = (growing_sine(f, period, cycles=cycles, triangle=triangle, hold=0.0) for f in (1.0, 10.0, 100.0))
    voltage = np.concatenate((np.full(4000, 5.0), *parts))
    found = content(voltage, period, initial_voltage=0.0)
    assert found.lines > 48 and found.bandwidth > 30.0
    assert not found.is_broadband


def test_noise_and_chirps_are_broadband(random):
    time = 1e-4 * np.arange(20_000)
    chirp = np.sin(2 * np.pi * 1.0 * np.expm1(np.log(500.0) / 2.0 * time) / np.log(500.0) * 2.0)
    binary = np.repeat(random.choice([1.0, 9.0], 2000), 10)
    short = np.repeat(random.uniform(0.0, 10.0, 200), 100)  # held for 10 ms, while the stage still rings
    noise = random.standard_normal(20_000)
    for voltage in (noise, 5.0 + 0.01 * noise, chirp, binary, short):
        assert content(voltage, 1e-4).is_broadband
        assert not content(voltage, 1e-4).levels


LEVELS = np.concatenate((np.linspace(0.0, 10.0, 21), np.linspace(10.0, 0.0, 21)[1:]))


@pytest.mark.parametrize("noise", [0.0, 1e-4, 5e-4])
@pytest.mark.parametrize(
    "voltage",
    [np.repeat(LEVELS, 500), np.repeat(np.tile([0.0, 1.0], 10), 1000), np.repeat(LEVELS, 60)],
    ids=["staircase", "square", "fast staircase"],
)
def test_many_steps_show_the_same_step_response_only(voltage, noise, random):
    voltage = voltage + noise * np.ptp(voltage) * random.standard_normal(voltage.size)
    assert content(voltage, 1e-3).levels
    assert not content(voltage, 1e-3).is_broadband


def test_where_no_drive_is_slow_the_slower_ones_show_the_loop(random):
    """Loops at 400 Hz, steps and noise show the dynamics as much; the operator ended as a relay."""
    time = 1e-4 * np.arange(10_000)
    drives = [5.0 - 4.0 * np.cos(2.0 * np.pi * f * time) for f in (50.0, 100.0, 400.0)]
    drives += [random.uniform(0.0, 10.0, time.size), np.repeat([0.0, 9.0, 2.0, 7.0], time.size // 4)]
    experiment = Experiment(tuple(Record(u, 1e-6 * u, 1e-4, initial_voltage=0.0) for u in drives))
    assert roles_of(experiment).loops == (0, 1)


def test_ramps_between_levels_are_changes_of_one_way():
    ramped = np.interp(np.arange(20_500), (500 * np.arange(41)[:, None] + [20, 500]).ravel(), np.repeat(LEVELS, 2))
    assert content(ramped, 1e-3).levels


def test_a_fast_triangle_after_a_hold_does_not_determine_the_dynamics():
    drive = growing_sine(60.0, 5e-4, (0.4, 0.7, 1.0), triangle=True)
    record = Record(drive, 1e-6 * drive, 5e-4, "triangle", initial_voltage=0.0)
    assert roles_of(Experiment((record,))).broadband == ()


@pytest.mark.parametrize("period", [1e-4, 1e-3])
@pytest.mark.parametrize("cycles", [3.3, 5.3, 12.4])
@pytest.mark.parametrize("rest", [0.0, 0.05])
def test_the_highest_frequency_of_a_short_sine_is_its_rate(period, cycles, rest):
    """Its power is spread over neighbouring frequencies: 95 % of that of 5.3 cycles of 60 Hz are below 68 Hz."""
    sine = 5.0 - 4.0 * np.cos(2.0 * np.pi * 60.0 * period * np.arange(round(cycles / 60.0 / period)))
    voltage = np.concatenate((np.full(round(rest / period), 1.0), sine, np.full(round(rest / period), sine[-1])))
    assert content(voltage, period).highest == pytest.approx(60.0, rel=0.03)


def test_the_highest_frequency_of_other_drives_includes_their_harmonics(random):
    for voltage in (triangle(10.0, 2.0, 1e-3), random.standard_normal(20_000)):
        found = content(voltage, 1e-3)
        assert found.highest == found.bandwidth > 30.0


def test_a_rest_whose_voltage_was_measured_with_noise_shows_no_dynamics():
    """The stage has not seen that noise; a commanded noise of the same size it has."""
    time, rng = 1e-3 * np.arange(4000), np.random.default_rng(0)
    loops, rest = 60.0 - 90.0 * np.cos(2.0 * np.pi * time), np.full(1000, -30.0)
    rest[:8] = loops[7::-1]
    shaken = rest + 0.05 * rng.standard_normal(rest.size)

    def broadband(*drives):
        return roles_of(Experiment(tuple(Record(u, 1e-8 * u, 1e-3) for u in drives))).broadband

    assert broadband(loops, shaken) == (1,)
    assert broadband(loops + 0.05 * rng.standard_normal(loops.size), shaken) == ()
