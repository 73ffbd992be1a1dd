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

"""Names and boundaries of phases, from the drive alone."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from piezo_hysteresis.errors import RecordingError
from piezo_hysteresis.record import Record
from piezo_hysteresis.recording.segmentation.phases import labelled, propose
from piezo_hysteresis.recording.segmentation.waveform import phase_name

PERIOD = 1e-4


def time(duration):
    return np.arange(round(duration / PERIOD)) * PERIOD


def triangle(duration, frequency):
    return 2 * np.abs(np.mod(frequency * time(duration), 1.0) * 2 - 1)


def noise(duration, seed=0):
    white = np.random.default_rng(seed).normal(size=time(duration).size + 20)
    return np.convolve(white, np.ones(21) / 21, "valid")


def chirp(duration, low, high):
    rate = np.log(high / low) / duration
    return np.sin(2 * np.pi * low * np.expm1(rate * time(duration)) / rate)


def multisine(period, repeats, seed=0):
    phases = np.random.default_rng(seed).uniform(0, 2 * np.pi, 40)
    one = sum(np.cos(2 * np.pi * (2 * k + 1) * time(period) / period + p) for k, p in enumerate(phases))
    return np.tile(one, repeats)


@settings(max_examples=30)
@given(
    frequency=st.floats(0.5, 400.0),
    amplitude=st.floats(1e-3, 100.0),
    offset=st.floats(-100.0, 100.0),
    start=st.floats(0.0, 1.0),
    periods=st.floats(4.0, 40.0),
)
def test_a_sine_is_named_by_its_frequency(frequency, amplitude, offset, start, periods):
    n = int(periods / frequency / PERIOD)
    name = phase_name(offset + amplitude * np.sin(2 * np.pi * (frequency * np.arange(n) * PERIOD + start)), PERIOD)
    assert name.startswith("sine_")
    assert float(name[5:-2]) == pytest.approx(frequency, rel=0.05)


def test_one_period_about_zero_is_named_by_its_frequency_too():
    swing = np.sin(2 * np.pi * 10.0 * np.arange(0.0, 0.1, PERIOD))
    name = phase_name(np.concatenate([np.zeros(10), swing]), PERIOD)
    assert float(name.removeprefix("sine_").removesuffix("hz")) == pytest.approx(10.0, rel=0.1)


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("measured_noise", [0.0, 1e-3])
@pytest.mark.parametrize(
    ("wave", "name"),
    [
        (np.zeros(500), "rest"),
        (triangle(4.0, 1.0), "triangle"),
        (np.concatenate([a * (2 - triangle(1.0, 1.0)) for a in (0.25, 0.5, 0.75, 1.0)]), "triangle"),
        (chirp(2.0, 1.0, 500.0), "chirp"),
        (chirp(2.0, 1.0, 500.0)[::-1], "chirp"),
        (multisine(0.2, 4), "multisine"),
        (noise(2.0), "noise"),
        (np.repeat([0.0, 1.0, 0.0, 1.0, 0.0], 500), "steps"),
        (np.repeat([0.0, 1.0], 500), "step"),
        (np.linspace(0.0, 1.0, 500), "ramp"),
    ],
)
def test_waveforms_are_distinguished_also_when_the_drive_was_measured(wave, name, measured_noise, seed):
    wave = wave + measured_noise * np.ptp(wave) * np.random.default_rng(seed).normal(size=wave.size)
    assert phase_name(wave, PERIOD) == name


def test_a_long_record_is_split_where_the_drive_rests_and_moves():
    parts = [
        ("rest", np.zeros(3000)),
        ("sine_50hz", 1 - np.cos(2 * np.pi * 50 * time(0.5))),
        ("rest", np.zeros(2000)),
        ("triangle", 2 - triangle(3.0, 1.0)),
        ("rest", np.zeros(2500)),
        ("noise", np.hanning(20000) * noise(2.0)),
        ("rest", np.zeros(2500)),
    ]
    proposal = propose(np.concatenate([wave for _, wave in parts]), PERIOD)
    assert [name for _, name in proposal] == [name for name, _ in parts]
    edges = np.cumsum([0, *(wave.size for _, wave in parts[:-1])])
    np.testing.assert_allclose([start for start, _ in proposal], edges, atol=100)


def test_a_step_keeps_the_rest_before_it_in_sight():
    wave = np.repeat([0.0, 5.0], [4000, 3000])
    proposal = propose(wave, PERIOD)
    assert [name for _, name in proposal] == ["rest", "step"]
    assert 1000 <= proposal[1][0] < 3999


@pytest.mark.parametrize(
    ("levels", "name"), [((0, 1, 0, 1, 0), "steps"), ((0, 1, 2, 3, 2, 1, 0), "staircase"), ((0, 3), "step")]
)
@pytest.mark.parametrize("measured_noise", [0.0, 1e-4])
def test_levels_with_jumps_are_one_phase(levels, name, measured_noise):
    wave = np.repeat(np.array(levels, float), 3000)
    wave += measured_noise * np.random.default_rng(0).normal(size=wave.size)
    assert [n for _, n in propose(wave, PERIOD)] == ["rest", name]


def test_the_flat_tops_of_a_quantised_sine_are_not_holds():
    wave = np.round(2.5 * np.sin(2 * np.pi * 0.5 * time(8.0)) * 2**12) / 2**12
    assert propose(wave, PERIOD) == [(0, "sine_0.5hz")]


@pytest.mark.parametrize("frequency", [0.1, 1.0, 10.0])
@pytest.mark.parametrize("measured_noise", [0.0, 1e-4])
def test_the_bottom_at_which_a_sine_begins_is_not_a_rest(frequency, measured_noise):
    wave = 1.0 - np.cos(2 * np.pi * frequency * time(3.0 / frequency))
    wave += measured_noise * np.random.default_rng(0).normal(size=wave.size)
    assert propose(wave, PERIOD) == [(0, f"sine_{frequency:g}hz")]
    after_rest = np.concatenate((np.zeros(wave.size // 10), wave))
    assert [name for _, name in propose(after_rest, PERIOD)] == ["rest", f"sine_{frequency:g}hz"]


@settings(max_examples=30)
@given(st.lists(st.floats(-10, 10), min_size=1, max_size=300), st.integers(1, 30))
def test_any_drive_is_covered_from_first_to_last_sample(values, repeat):
    wave = np.repeat(np.array(values), repeat)
    proposal = propose(wave, PERIOD)
    starts = [start for start, _ in proposal]
    assert starts[0] == 0
    assert all(a < b for a, b in zip(starts, [*starts[1:], wave.size], strict=True))


def test_names_given_go_before_proposals():
    record = Record(np.arange(100.0), np.arange(100.0), 0.01)
    assert [r.phase for r in labelled([record], "ramp_up")[0]] == ["ramp_up"]
    records, notices = labelled([record], [(0.1, "a"), (0.5, "b")])
    assert [(r.phase, r.size, r.start_time) for r in records] == [("a", 40, 0.1), ("b", 50, 0.5)]
    assert not notices
    with pytest.raises(RecordingError, match="growing"):
        labelled([record], [(0.5, "a"), (0.5, "b")])
    with pytest.raises(RecordingError, match="before"):
        labelled([record], [(7.0, "a")])


@pytest.mark.parametrize("samples", [8, 10, 16, 20, 25, 40])
@pytest.mark.parametrize("faded", [False, True])
def test_a_sine_of_few_samples_per_period_has_no_levels(samples, faded):
    t = np.arange(40 * samples)
    fade = np.minimum(1.0, np.minimum(t, t[::-1]) / samples) if faded else 1.0
    name = phase_name(5 + fade * np.sin(2 * np.pi * t / samples), PERIOD)
    assert float(name.removeprefix("sine_").removesuffix("hz")) == pytest.approx(1 / samples / PERIOD, rel=0.005)


@pytest.mark.parametrize("cycles", [2.5, 3, 5, 10.3])
@pytest.mark.parametrize(("grows", "noise"), [(False, 0.0), (True, 0.0), (False, 0.005)])
def test_a_sine_is_named_with_the_digits_that_its_duration_shows(cycles, grows, noise):
    """10 Hz was named 9.99, 10.1 or 9.92 Hz for a tenth of these drives."""
    for frequency in (1.0, 10.0, 50.0):
        t = PERIOD / 10 * np.arange(int(10 * cycles / frequency / PERIOD))
        size = np.linspace(0.2, 1.0, t.size) if grows else 1.0
        drive = 5.0 + size * np.sin(2.0 * np.pi * frequency * t + 0.5)
        drive += noise * np.random.default_rng(0).normal(size=t.size)
        assert phase_name(drive, PERIOD / 10) == f"sine_{frequency:g}hz"


def test_a_long_sine_keeps_three_digits():
    t = PERIOD * np.arange(round(20.0 / PERIOD))
    assert phase_name(np.sin(2.0 * np.pi * 9.93 * t), PERIOD) == "sine_9.93hz"


def test_the_name_of_a_fast_sine_is_a_plain_number():
    assert phase_name(np.sin(2 * np.pi * 1.25e4 * np.arange(4000) * 2e-6), 2e-6) == "sine_12500hz"


@pytest.mark.parametrize("size", [200, 4000])
def test_white_noise_is_noise(size):
    """A swing of one sample is straight, whatever the drive."""
    drive = np.random.default_rng(3).standard_normal(size)
    assert [name for _, name in propose(drive, 1e-3)] == ["noise"]


@pytest.mark.parametrize("hold", [0.2, 0.3])
def test_straight_motion_with_short_holds_is_a_trapezoid(hold):
    """One, or a wave: a hold that is short against the motion counts as the top of a wave."""
    times = np.cumsum([0.3, 1.0, hold, 1.0, hold] + [1.0, hold] * 4 + [0.3])
    levels = [0.0, 8.0, 8.0, 0.0, 0.0, 8.0, 8.0, 0.0, 0.0, 8.0, 8.0, 0.0, 0.0, 0.0]
    for count in (4, times.size):
        drive = np.interp(np.arange(round(1e3 * times[count - 1])) * 1e-3, times[:count], levels[:count])
        names = [name for _, name in propose(drive, 1e-3)]
        assert "trapezoid" in names
        assert not {"noise", "multisine"} & set(names)
        assert not any(name.startswith("sine") for name in names)
