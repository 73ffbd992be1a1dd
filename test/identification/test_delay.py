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

"""The delay is exact from the step, whatever the noise, and the answer says when it cannot be known."""

import numpy as np
import pytest
from scipy.signal import lfilter

from benchmarks.published_plant import SAMPLE_PERIOD, STROKE, displacement
from piezo_hysteresis.errors import IdentificationError
from piezo_hysteresis.identification.protocol import protocol
from piezo_hysteresis.identification.records.edges import find_edges
from piezo_hysteresis.identification.steps.delay import identify_delay
from piezo_hysteresis.record import Record

STEP = next(p.voltage for p in protocol.paper() if p.name == "step")
CLEAN = displacement(STEP)


def step_record(noise, seed=0, every=1):
    random = np.random.default_rng(seed)
    y = CLEAN + noise * STROKE * random.standard_normal(CLEAN.size)
    return Record(STEP[::every], 1e-6 * y[::every], SAMPLE_PERIOD * every, "step")


@pytest.mark.parametrize("noise", [0.0, 0.0005, 0.005])
def test_three_samples_at_every_noise(noise):
    for seed in range(20):
        delay = identify_delay([step_record(noise, seed)])
        assert delay.samples == 3
        assert delay.time == pytest.approx(60e-6)
        assert all(n.kind != "delay_unresolved" for n in delay.notices)


@pytest.mark.parametrize("resonance", [300.0, 700.0, 1900.0])
@pytest.mark.parametrize("samples", [1, 3])
def test_edges_before_which_the_stage_rings_are_not_used(resonance, samples):
    pole = np.exp(2 * np.pi * resonance * SAMPLE_PERIOD * (-0.01 + 1j))
    mode = np.real(np.poly([pole, np.conj(pole)]))
    quiet = np.repeat([0.0, 1.0], 1000)
    trapezoids = np.repeat([0.0, 5.0, 0.0, 8.0, 3.0, 9.0, 1.0], 200)
    records = []
    for name, drive in (("step", quiet), ("steps", trapezoids)):
        y = lfilter([mode.sum()], mode, np.concatenate([np.zeros(samples), drive[:-samples]]))
        noise = 5e-9 * np.random.default_rng(0).standard_normal(y.size)
        records.append(Record(drive, 1e-6 * y + noise, SAMPLE_PERIOD, name))
    assert samples <= identify_delay(records).samples <= identify_delay(records[:1]).samples + 1


def test_noise_that_hides_the_first_response_is_reported():
    for seed in range(10):
        delay = identify_delay([step_record(0.02, seed)])
        assert delay.samples in (3, 4, 5)
        assert delay.samples == 3 or any(n.kind == "delay_ambiguous" for n in delay.notices) or delay.samples == 5


def test_sample_times_agree_on_60_microseconds():
    delay = identify_delay([step_record(0.0005)])
    assert [round(o.sample_period / SAMPLE_PERIOD) for o in delay.onsets] == [1, 2, 3, 5]
    assert all(o.earliest < 60e-6 <= o.latest + 1e-12 for o in delay.onsets)
    assert not delay.notices


def test_records_taken_at_other_periods_are_compared():
    delay = identify_delay([step_record(0.0005), step_record(0.0005, 1, every=3)], factors=())
    assert [o.samples for o in delay.onsets] == [3, 1]


def test_the_deviation_of_the_averaged_response_is_that_of_the_noise():
    errors = []
    exact = identify_delay([step_record(0.0)]).response.mean
    for seed in range(10):
        response = identify_delay([step_record(0.005, seed)], factors=()).response
        errors.append((response.mean[:40] - exact[:40]) / response.deviation[:40])
    assert np.std(errors) == pytest.approx(1.0, abs=0.15)


def test_slow_data_give_an_upper_bound_with_a_notice():
    voltage = np.repeat([0.0, 5.0, 0.0, 5.0], 60)
    pole = np.exp(-5e-3 / 13e-3)
    y = lfilter([0.0, 1.0 - pole], [1.0, -pole], voltage)
    random = np.random.default_rng(0)
    delay = identify_delay([Record(voltage, 1e-6 * (y + 1e-3 * random.standard_normal(y.size)), 5e-3, "step")])
    assert delay.samples == 1
    assert any(n.kind == "delay_unresolved" for n in delay.notices)


@pytest.mark.parametrize(
    "record",
    [
        Record(np.zeros(1000), np.zeros(1000), 1e-3),
        Record(np.sin(np.arange(1000.0)), np.zeros(1000), 1e-3),
        Record(STEP, np.random.default_rng(0).standard_normal(STEP.size), SAMPLE_PERIOD),
    ],
)
def test_without_a_visible_step_the_error_states_what_is_missing(record):
    with pytest.raises(IdentificationError, match=r"step"):
        identify_delay([record])


def test_edges_are_found_with_their_heights():
    voltage = np.concatenate(
        [np.zeros(50), np.full(40, 2.0), np.linspace(2.0, 1.0, 200), np.full(60, 1.0), np.zeros(30)]
    )
    edges = find_edges(voltage, 8, 4)
    assert [(e.start, e.height) for e in edges] == [(50, 2.0), (350, -1.0)]


def test_percentages_of_noise_refer_to_the_full_stroke():
    rise = displacement(np.linspace(0.0, 10.0, 50_000))
    assert rise[-1] == pytest.approx(STROKE, rel=1e-3)


def test_ringing_before_the_edges_does_not_make_the_onset_earlier():
    # 900 Hz, lightly damped: a twentieth of the ringing of each edge is left when the next one comes
    period, delay = 2e-5, 8
    time = period * np.arange(800)
    ring = 1.0 - np.exp(-190.0 * time) * np.cos(2 * np.pi * 900.0 * time)
    levels = np.tile([0.0, 5.0], 6)
    voltage = np.repeat(levels, 800)
    y = np.zeros(voltage.size)
    for number, jump in enumerate(np.diff(levels), 1):
        start = 800 * number + delay
        y[start:] += jump * np.interp(period * np.arange(y.size - start), time, ring, right=1.0)
    y = 1e-6 * y + 1e-9 * np.random.default_rng(0).standard_normal(y.size)
    found = identify_delay([Record(voltage, y, period, "steps")])
    assert abs(found.samples - delay) <= 2
