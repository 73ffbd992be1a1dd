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

"""Any mix of records gives a model that predicts data it has not seen, and says what it could not know."""

import re
from dataclasses import replace

import numpy as np
import pytest

from benchmarks.nanopositioner import Nanopositioner
from piezo_hysteresis.effects import Arx, BoucWen
from piezo_hysteresis.errors import IdentificationError, RecordError
from piezo_hysteresis.identification import DriveLimits, identify
from piezo_hysteresis.identification.fit.normal_equations import Nuisance, residuals
from piezo_hysteresis.identification.protocol import excitation
from piezo_hysteresis.model.model import Model
from piezo_hysteresis.record import Experiment, Record

LIMITS = DriveLimits(sample_period=1e-4)
TRUTH = Model((BoucWen(), Arx(a=(-1.2, 0.45), b=(0.15, 0.1), delay=3.0)), 1e-4, 10.0, 1e-5)
NOISE = 2e-9


def play(*bodies, limits=LIMITS, seed=0, every=1, offset=0.0, continues=False):
    """Records of the truth with noise and a sensor zero, from named waveform bodies."""
    random = np.random.default_rng(seed)
    empty = [
        Record(v, np.zeros(v.size), limits.sample_period, name, continues=continues and i > 0)
        for i, (name, v) in enumerate((name, limits.from_safe_to_safe(body)) for name, body in bodies)
    ]
    outputs = TRUTH.simulate(empty)
    return [
        Record(
            r.voltage,
            y + offset + NOISE * random.standard_normal(r.size),
            r.sample_period,
            r.phase,
            continues=r.continues,
        ).decimate(every)
        for r, y in zip(empty, outputs, strict=True)
    ]


def triangle(limits=LIMITS):
    return "triangle", excitation.triangle(limits, (1.0, 0.5), 1.0)


def noise(rms=0.05, seed=0):
    return "noise", excitation.noise(LIMITS, rms, 2e3, 1.0, 0.35, seed)


def step():
    return "step", excitation.steps(LIMITS, (0.2, 0.5, 0.8, 0.5) * 5, 0.02)


def mixture(seed, limits=LIMITS):
    return "record", excitation.mixture(limits, 1.0, seed)


def percent(model, records):
    errors = residuals(model, records, Nuisance(offset=True))
    return max(100.0 * np.std(e) / np.ptp(r.displacement) for e, r in zip(errors, records, strict=True))


@pytest.fixture(scope="module")
def complete():
    records = play(step(), noise(0.05), noise(0.01, 1), triangle(), ("validation", excitation.mixture(LIMITS, 1.0, 9)))
    return identify(Experiment(tuple(records), "complete"), gain=TRUTH["arx"].dc_gain, displacement_scale=1e-5)


def test_three_phases_give_the_truth_within_its_uncertainty(complete):
    deviates = [
        (v - TRUTH.values()[n]) / complete.fit.standard_errors[n]
        for n, v in complete.fit.values.items()
        if n.startswith("bouc_wen.")
    ]
    assert np.max(np.abs(deviates)) < 4.0
    assert complete.delay.samples == 3
    assert complete.fit.converged


def test_the_frequency_response_has_the_right_uncertainty(complete):
    frequency = np.geomspace(1.0, 2000.0, 20)
    value, error = complete.response(frequency)
    off = np.abs(value / TRUTH["arx"].response(frequency, 1e-4) - 1.0)
    assert np.all(off < 4.0 * error)
    assert np.median(error) < 2e-3 and error.max() < 0.05


def test_validation_is_not_fitted_and_predicted_to_the_noise(complete):
    assert [p.phase for p in complete.phases if not p.is_fitted] == ["validation"]
    assert complete.free_run_error == pytest.approx(NOISE, rel=0.05)
    assert complete.model.provenance["source"] == "complete"


def test_the_comparison_shows_the_bias_from_noise(complete):
    low, high = complete.comparisons
    assert low.amplitude < high.amplitude
    assert low.from_v > 1.2 * low.from_w
    assert low.from_w == pytest.approx(high.from_w, rel=0.05)
    assert not complete.notices


def test_the_result_can_be_read(complete):
    text = str(complete)
    for word in ("delay 3 samples", "bouc_wen.gamma", "±", "not fitted", "% of range"):
        assert word in text


def test_orders_are_chosen_on_request():
    found = identify(Experiment(tuple(play(step(), noise(), triangle()))), orders=None)
    assert 2 <= found.model["arx"].array("a").size <= 6
    assert percent(found.model, play(mixture(3), seed=4)) < 0.1


def test_a_single_foreign_record_is_enough():
    found = identify(Experiment(tuple(play(mixture(1)))), orders=(4, 4))
    kinds = {n.kind for n in found.notices}
    assert {"no_step", "delay_from_fit", "nothing_held_out"} <= kinds
    assert percent(found.model, play(mixture(2), seed=5)) < 0.1


def test_records_with_their_own_sensor_zero_and_bipolar_drive():
    bipolar = DriveLimits(sample_period=1e-4, voltage_min=-10.0, voltage_max=10.0)
    records = play(mixture(1, bipolar), limits=bipolar, offset=3e-5)
    records += play(mixture(2, bipolar), limits=bipolar, seed=1, offset=-8e-5)
    found = identify(Experiment(tuple(records)), orders=(4, 4))
    assert percent(found.model, play(mixture(5, bipolar), limits=bipolar, seed=7)) < 0.1


def test_records_that_continue_keep_the_state():
    bodies = (step(), noise(), triangle())
    joined = Experiment(tuple(play(*bodies, continues=True)))
    found = identify(joined, orders=(2, 2))
    assert found.fit.cost < 1.5
    assert percent(found.model, play(mixture(3), seed=4)) < 0.1


def test_slow_data_give_loop_and_lag_with_a_notice():
    # 1 Hz loops sampled at 200 Hz, with a jump from rest at the beginning that shows dead time and pole
    slow = Model((BoucWen(), Arx(a=(-0.68,), b=(0.32,), delay=1.0)), 5e-3, 10.0, 1e-5)
    time = 5e-3 * np.arange(3000)
    voltage = 5.0 + (2.0 + time / 5.0) * np.sin(2 * np.pi * time)
    clean = slow.simulate(Record(voltage, time, 5e-3, initial_voltage=0.0))[0]
    measured = clean + NOISE * np.random.default_rng(0).standard_normal(time.size) - 1e-4
    found = identify(Experiment((Record(voltage, measured, 5e-3, "sine_1hz", initial_voltage=0.0),)))
    assert any(n.kind == "lag_only" for n in found.notices)
    lag = found.model["arx"].group_delay * found.model.sample_period
    assert lag == pytest.approx(slow["arx"].group_delay * 5e-3, rel=0.02)
    assert found.fit.rms[0] == pytest.approx(NOISE, rel=0.05)


def test_phases_stored_slowly_join_fast_ones():
    records = play(step(), noise()) + play(triangle(), every=5)
    found = identify(Experiment(tuple(records)), orders=(2, 2))
    assert percent(found.model, play(mixture(3), seed=4)) < 0.15


@pytest.mark.parametrize("voltage", [np.zeros(1000), np.full(1000, 5.0)])
def test_without_motion_the_error_states_what_is_missing(voltage):
    with pytest.raises(IdentificationError, match="does not move"):
        identify(Experiment((Record(voltage, np.zeros(1000), 1e-3),)))


def test_loops_after_a_gap_are_fitted_where_nothing_else_moves():
    time = 1e-3 * np.arange(6000)
    stage = Model((BoucWen(), Arx(a=(), b=(1.0,), delay=2.0)), 1e-3, 10.0, 1e-5)
    voltage = np.concatenate((np.zeros(500), 5.0 - 4.5 * np.cos(2 * np.pi * time)))
    measured = stage.simulate(Record(voltage, voltage, 1e-3))[0]
    measured += NOISE * np.random.default_rng(0).standard_normal(voltage.size)
    rest, _, loops = Record(voltage, measured, 1e-3).split(500, 600)
    found = identify(Experiment((rest, replace(loops, truncated=True, continues=False))))
    assert found.free_run_error == pytest.approx(NOISE, rel=0.2)


def test_a_stage_that_was_never_driven_back_is_not_said_to_be_known():
    (whole,) = play(("ramp", np.linspace(0.0, 8.0, 4000)))
    (found,) = (n for n in identify(whole[:3000]).notices if n.kind == "one_way")
    assert found.severe


@pytest.mark.parametrize(
    ("size", "gain", "message"),
    [(1000, 0.0, "never changes"), (1000, 1e-206, "never changes"), (5, 1e-6, "got 5 samples in")],
)
def test_a_dead_sensor_or_a_few_samples_are_named(size, gain, message):
    voltage = np.linspace(0.0, 9.0, size)
    with pytest.raises(IdentificationError, match=message):
        identify(Experiment((Record(voltage, gain * voltage, 1e-3),)))


def test_a_truncated_record_is_fitted_from_its_first_full_loop():
    time = 1e-3 * np.arange(6000)
    slow = Model((BoucWen(), Arx(a=(), b=(1.0,), delay=2.0)), 1e-3, 10.0, 1e-5)
    voltage = 5.0 + 4.5 * np.sin(2 * np.pi * time + 1.0)
    measured = slow.simulate(Record(voltage, time, 1e-3, initial_voltage=0.0))[0]
    measured += NOISE * np.random.default_rng(0).standard_normal(time.size)
    cut = Record(voltage[2300:], measured[2300:], 1e-3, "sine_1hz", truncated=True)
    found = identify(Experiment((cut,)))
    assert any(n.kind == "conditioning_length" for n in found.notices)
    assert found.free_run_error == pytest.approx(NOISE, rel=0.1)


def test_one_frequency_is_reported_with_the_lag_that_was_found():
    time = 1e-3 * np.arange(4000)
    slow = Model((BoucWen(), Arx(a=(), b=(1.0,), delay=4.0)), 1e-3, 10.0, 1e-5)
    voltage = 5.0 - 5.0 * np.cos(2 * np.pi * 2.0 * time)
    measured = slow.simulate(Record(voltage, time, 1e-3))[0] + NOISE * np.random.default_rng(0).standard_normal(4000)
    found = identify(Experiment((Record(voltage, measured, 1e-3, "sine_2hz"),)))
    messages = {n.kind: n.message for n in found.notices}
    assert "one_frequency" in messages
    value, error = (float(x) for x in re.findall(r"([\d.]+) ms", messages["lag_only"]))
    assert value == pytest.approx(4.0, abs=3 * error)


@pytest.mark.parametrize("with_step", [False, True])
def test_rests_and_steps_have_no_highest_frequency(with_step):
    """The drive ends at the frequency of the sine, and after a rest it has still only one."""
    time = 1e-3 * np.arange(4000)
    slow = Model((BoucWen(), Arx(a=(), b=(1.0,), delay=4.0)), 1e-3, 10.0, 1e-5)
    swing = np.concatenate((np.full(1000, 5.0), 5.0 + 4.0 * np.sin(2.0 * np.pi * 2.0 * time)))
    start = np.zeros(600) if with_step else np.linspace(4.96, 5.0, 600)
    voltage = np.concatenate((start, swing))
    measured = slow.simulate(Record(voltage, voltage, 1e-3))[0]
    measured += NOISE * np.random.default_rng(0).standard_normal(voltage.size)
    records = Record(voltage, measured, 1e-3).split(500, 1600)
    found = identify(Experiment(records))
    messages = {n.kind: n.message for n in found.notices}
    (ends,) = re.findall(r"the drive ends at ([\d.]+) Hz", messages["lag_only"])
    assert float(ends) == pytest.approx(2.0, rel=0.02)
    assert ("one_frequency" in messages) is not with_step


def test_a_stage_that_lags_by_less_than_a_sample_is_identified():
    # 0.1 Hz loops sampled at 200 Hz, of a stage that follows at once
    time = 5e-3 * np.arange(8000)
    voltage = 5.0 - (1.0 + time / 10.0) * np.cos(2 * np.pi * 0.1 * time)
    loop = Model((BoucWen(), Arx(a=(), b=(1.0,), delay=1.0)), 5e-3, 10.0, 1e-5)
    early = loop.simulate(Record(voltage, time, 5e-3))[0][1:]
    measured = early + NOISE * np.random.default_rng(0).standard_normal(early.size)
    found = identify(Experiment((Record(voltage[:-1], measured, 5e-3, "sine_0.1hz"),)))
    assert found.model["arx"]["delay"] == pytest.approx(0.0, abs=0.1)
    assert found.model.sample_period == 5e-3
    assert any(n.kind == "lag_only" for n in found.notices)


@pytest.mark.parametrize("levels", [(2.0, 8.0), (0.0, 10.0)])
def test_a_binary_drive_alone_is_identified(levels):
    """Two levels hardly determine the height of a loop; a start outside its bounds was an error."""
    drive = np.repeat(np.random.default_rng(1).choice(levels, 400), 20)
    record = Nanopositioner.random(np.random.default_rng(3)).play(drive, 1e-3, "noise")
    assert identify(record, memory=True).free_run_percent < 0.3


@pytest.mark.parametrize("mode", [300.0, 400.0, 532.0])
def test_a_binary_drive_faster_than_the_ringing_predicts_another_one(mode):
    """The fit of high orders does not converge, because two levels leave the loop open; low orders do not ring."""
    stage, random = Nanopositioner(mode=mode), np.random.default_rng(1)
    first, second = (stage.play(np.repeat(random.choice([2.0, 8.0], n), 10), 5e-4, "noise") for n in (200, 100))
    assert percent(identify(first).model, [second]) < 0.3


def test_phases_that_are_held_out_must_exist():
    experiment = Experiment(tuple(play(triangle())))
    with pytest.raises(RecordError, match="got phase 'sine', expected some of triangle"):
        identify(experiment, held_out=("sine",))
    with pytest.raises(RecordError, match="every phase"):
        identify(experiment, held_out=("triangle",))


def test_parameters_that_the_drive_does_not_separate_are_not_stated_as_known():
    """A drive that only rises shows β + γ, and neither of them."""
    u = np.linspace(0.0, 10.0, 3000)
    (y,) = TRUTH.simulate(Record(u, np.zeros(u.size), TRUTH.sample_period, initial_voltage=0.0))
    noisy = y + NOISE * np.random.default_rng(1).normal(size=u.size)
    found = identify(Experiment((Record(u, noisy, TRUTH.sample_period, phase="ramp", initial_voltage=0.0),)))
    for name in ("bouc_wen.beta", "bouc_wen.gamma"):
        low, high = found.fit.interval(name)
        assert low < TRUTH.values()[name] < high
    assert [n.severe for n in found.notices if n.kind == "not_identifiable"] == [True]


@pytest.mark.parametrize("shaken", [0.0, 2e-3])
def test_rests_between_the_drives_do_not_lower_the_stated_error(shaken):
    """A rest shows the noise alone; with or without it, the motion is predicted as badly."""
    time = 1e-3 * np.arange(3000)
    stage = Model((BoucWen(), Arx(a=(), b=(1.0,), delay=2.0)), 1e-3, 10.0, 1e-5)
    drive = 4.0 - 4.0 * np.cos(2 * np.pi * time)
    voltage = np.concatenate((np.zeros(1000), drive, np.zeros(1000), 0.5 * drive, np.zeros(1000)))
    moved = stage.simulate(Record(voltage, voltage, 1e-3))[0]
    measured = moved + 2e-7 * np.sin(3.0 * np.pi * voltage) + NOISE * np.random.default_rng(0).standard_normal(9000)
    voltage = voltage + shaken * np.random.default_rng(1).standard_normal(voltage.size)
    parts = Record(voltage, measured, 1e-3).split(1000, 4000, 5000, 8000)
    found = identify(Experiment(parts))
    errors = [found.phases[i].rms for i in (1, 3)]
    assert found.free_run_error == pytest.approx(np.sqrt(np.mean(np.square(errors))))
    assert found.free_run_error > 1.2 * np.sqrt(np.mean([p.rms**2 for p in found.phases]))
    assert found.model.provenance["free_run_error"] == found.model.provenance["moving_record_error"]
