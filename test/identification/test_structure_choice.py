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

"""The structure of a model of a stage that creeps, bends and rings: steps and growing sines of an independent plant."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.nanopositioner import Nanopositioner, growing_sine
from piezo_hysteresis.effects import Arx, BoucWen, Creep, CreepTwoRates, ExtraResonance, HysteresisMemory
from piezo_hysteresis.identification.fit.normal_equations import Nuisance
from piezo_hysteresis.identification.free_run_error import errors
from piezo_hysteresis.identification.identify import identify
from piezo_hysteresis.identification.left_out import score_left_out
from piezo_hysteresis.identification.steps.remaining_lag import lag
from piezo_hysteresis.identification.structure.piece_fit import PieceFit, best_step, fit_pieces, linearised
from piezo_hysteresis.identification.structure.pieces import Kind, pieces_of
from piezo_hysteresis.identification.structure.prior import WANDER, WANDER_TIME
from piezo_hysteresis.identification.structure.structure_fit import fit_structure
from piezo_hysteresis.model.model import Model
from piezo_hysteresis.record import Experiment, Record

PERIOD = 5e-4
STAGE = Nanopositioner(mode=310.0, delay=2e-4, pole=2e-4)


def played(stage, frequencies, **shape):
    drives = ((f"sine_{f:g}hz", growing_sine(f, PERIOD, **shape)) for f in frequencies)
    return Experiment(tuple(stage.play(u, PERIOD, name) for name, u in drives))


def percents(model, experiment):
    return [row.percent for row in errors(model, experiment, Nuisance(offset=True)).rows]


@pytest.fixture(scope="module")
def identified():
    return identify(played(STAGE, (1.0, 50.0)), memory=True)


def test_a_rate_between_two_is_predicted(identified):
    assert max(percents(identified.model, played(STAGE, (1.0, 10.0, 50.0)))) < 0.3


def test_an_unchanged_model_is_scored_on_other_records(identified):
    """No number of it is free: what `diagnose --model` asks of the given model."""
    again = played(replace(STAGE, noise_seed=1), (1.0, 50.0)).records
    kept = score_left_out(identified.model, again, [STAGE.noise * STAGE.stroke] * 2, (0, 1), adjusts=False)
    worse = identified.model.with_values({"creep_two_rates.gamma_slow": 0.05})
    assert 0.0 <= kept < score_left_out(worse, again, [STAGE.noise * STAGE.stroke] * 2, (0, 1), adjusts=False)


def test_the_effects_of_the_stage_are_in_the_model(identified):
    assert HysteresisMemory.name in identified.model
    assert identified.model[HysteresisMemory.name]["virgin"] == 1.0
    creep = identified.model[CreepTwoRates.name]
    assert 0.0 < creep["gamma_fast"] < creep["gamma_slow"] < 0.03
    mode = identified.model[ExtraResonance.name]
    assert mode["f0"] == pytest.approx(STAGE.mode, rel=0.01)
    assert mode["zeta"] == pytest.approx(STAGE.zeta, abs=0.01)
    (notice,) = (n.message for n in identified.notices if n.kind == "ringing")
    assert f"a mode at {mode['f0']:.4g} Hz with a damping ratio of {mode['zeta']:.2g}" in notice


@pytest.mark.parametrize("damping", [1e2, 1e5, 1e8])
def test_a_damped_step_goes_downhill_however_far_the_zero_of_the_sensor_is(identified, damping):
    far = [replace(r, displacement=r.displacement + 1e-3) for r in played(STAGE, (1.0, 50.0))]
    pieces, sizes = pieces_of(far, (0, 1)), [STAGE.noise * STAGE.stroke] * 2
    model = identified.model.without("offset").with_values({"creep_two_rates.gamma_slow": 0.03})
    names = ("bouc_wen.p1", "creep_two_rates.gamma_slow", "extra_resonance.zeta")
    start = fit_pieces(model, pieces, sizes, names, max_iterations=1)
    step, own = best_step(start, start.total, damping), len(names)
    downhill = start.total[:own, -1] - start.total[:own, own:-1] @ start.slow
    assert np.all(np.sign(step[:own]) == np.sign(downhill))


def test_one_rate_predicts_others_and_larger_amplitudes():
    one = identify(played(STAGE, (1.0,), levels=(0.3, 0.6, 1.0)), memory=True)
    assert max(percents(one.model, played(STAGE, (1.0, 10.0, 50.0)))) < 0.12
    small = identify(played(STAGE, (1.0, 50.0), levels=(0.3, 0.6)), memory=True)
    assert max(percents(small.model, played(STAGE, (1.0, 50.0)))) < 0.12


def test_the_pole_of_a_lag_stays_between_zero_and_one(identified):
    """A root of A(z) below 0 is no lag: the response would alternate from sample to sample."""
    alternating = identified.model.with_effect(Arx(a=(0.4,), b=(1.4,), delay=1.0))
    records = [replace(r, displacement=alternating.simulate(r)[0]) for r in played(STAGE, (1.0, 50.0))]
    pieces, sizes = pieces_of(records, (0, 1)), [STAGE.noise * STAGE.stroke] * 2
    start = identified.model.without("offset").with_effect(Arx(a=(-0.3,), b=(0.7,), delay=1.0))
    assert -1.0 < fit_structure(start, pieces, sizes).model.values()["arx.a[0]"] < 1e-9


def test_creep_goes_on_after_records_that_continue_one_another():
    """The relaxations last far longer than the whole run, not only longer than the longest record."""
    period = 2e-3
    stage = Nanopositioner(mode=150.0, delay=2e-4, pole=2e-4, creep_fast=0.012, creep_slow=0.012)
    shown = ((1.0, 0.5), (5.0, 1.0), (1.0, 0.9), (20.0, 0.6))
    run = stage.play(np.concatenate([growing_sine(f, period, (size,), hold=8.0) for f, size in shown]), period)
    model = identify(Experiment(run.split(*range(2000, run.size - 200, 2000))), memory=True).model
    held = np.full(30000, 5.0)
    (y,) = model.simulate(Record(held, np.zeros(held.size), period, initial_voltage=0.0))
    from_6_to_60_s = (y[-1] - y[3000]) / (y[50] - model["offset"]["y0"])
    assert from_6_to_60_s == pytest.approx(0.012, rel=0.15)


def test_a_record_is_cut_by_its_drive():
    u = np.concatenate((growing_sine(1.0, PERIOD, (0.3, 0.9)), growing_sine(20.0, PERIOD, (0.9,), hold=0.0)))
    record = Nanopositioner().play(u, PERIOD)
    pieces = pieces_of([record], [0])
    assert [p.kind for p in pieces[:3]] == [Kind.STEP, Kind.HOLD, Kind.LOOP]
    loops = [p for p in pieces if p.kind is Kind.LOOP]
    assert {p.rate for p in loops} >= {0, 3}  # two classes per decade: 1 Hz and 20 Hz
    assert len({p.amplitude for p in loops}) >= 2
    assert sum(p.record.size for p in pieces) == u.size
    assert all(p.record.continues for p in pieces[1:])


@pytest.mark.parametrize("parted", [pytest.param(False, marks=pytest.mark.soak), True])
def test_a_stage_that_rests_before_the_step_rings_as_one_that_begins_with_it(parted):
    """Also if step and sine are phases of their own, as a drive is divided on reading."""
    stage = Nanopositioner(mode=300.0)
    whole = stage.play(np.concatenate((np.zeros(900), growing_sine(1.0, PERIOD))), PERIOD, "sine_1hz")
    records = whole.split(450, 1600) if parted else (whole,)
    found = identify(Experiment(records), memory=True)
    assert found.model[ExtraResonance.name]["f0"] == pytest.approx(300.0, rel=0.005)
    unseen = Experiment((stage.play(growing_sine(60.0, PERIOD, hold=0.1), PERIOD, "sine_60hz"),))
    assert max(percents(found.model, unseen)) < 0.65


def test_the_lag_of_a_stage_that_rings_too_fast_for_its_samples_is_inside_its_interval():
    """A mode of 1811 Hz at 2000 samples a second rings at 189 Hz, and the samples lag by more than the stage."""
    stage = Nanopositioner(mode=1811.0, zeta=0.043, delay=2.8e-4, pole=1.7e-4)
    found = identify(played(stage, (1.0,), levels=(0.5, 1.0)), memory=True)
    value, error = lag(found.fit)
    assert abs(value - stage.sampled_lag(PERIOD)) < 1.96 * error < 0.2 * value


@pytest.mark.parametrize(("delay", "percent"), [(150.0, 0.1), pytest.param(300.0, 0.2, marks=pytest.mark.soak)])
def test_a_delay_of_several_cycles_of_the_fastest_drive_is_found_from_the_step(delay, percent):
    stage = Nanopositioner(delay=delay * PERIOD)
    model = identify(played(stage, (1.0, 60.0)), memory=True).model
    assert max(percents(model, played(stage, (10.0,)))) < percent
    assert model["arx"]["delay"] == pytest.approx(delay, abs=2.0)


@pytest.mark.parametrize("period", [0.05, 1.0])
def test_drives_of_a_few_millihertz_need_no_mode(period):
    """Ten times the frequency of such a drive is below the range of a mode."""
    time = period * np.arange(2000)
    drives = [5.0 - 4.0 * np.cos(2.0 * np.pi * f / period * time) for f in (0.002, 0.01)]
    records = [Nanopositioner().play(u, period, f"slow_{k}") for k, u in enumerate(drives)]
    model = identify(Experiment(tuple(records)), memory=True).model
    assert ExtraResonance.name not in model


def check_reason(found):
    """The message lists the chosen structure, and gives a reason if another one in the list has a smaller error."""
    (said,) = (n.message for n in found.notices if n.kind == "structure")
    choice, errors = said.split("; prediction errors in units of the noise floor: ")
    chosen = choice.split("left out, ")[1].split(" was chosen")[0]
    values = {name: float(value) for name, value in (e.rsplit(" ", 1) for e in errors.split("; "))}
    assert values[chosen] == min(values.values()) or "the simplest within 1 % of the best" in choice
    no_plays = HysteresisMemory.name not in found.model
    assert ("plays + cubic" not in chosen) is no_plays
    assert any("takes their place" in n.message for n in found.notices if n.kind == "memory") is no_plays


@pytest.mark.parametrize("step", [False, True])
def test_one_rate_leaves_creep_in_the_model(step):
    """A longer lag or wider plays have the influence of creep at one rate, but predict other rates badly."""
    time = PERIOD * np.arange(4000)
    swing = np.concatenate([level * (1.0 - np.cos(2.0 * np.pi * time)) for level in (1.0, 2.0, 3.0, 4.0, 5.0)])
    fitted = growing_sine(1.0, PERIOD) if step else swing
    found = identify(Experiment((STAGE.play(fitted, PERIOD, "sine_1hz"),)), memory=True)
    check_reason(found)
    assert all(j.structure.creep_rates > 0 for j in found.structure.judged)
    assert {"creep", "creep_two_rates"} & {e.name for e in found.model.effects}
    faster = Experiment((STAGE.play(swing[::10], PERIOD, "sine_10hz"),))
    assert max(percents(found.model, faster)) < 0.65


@pytest.mark.parametrize("smaller", [1.0, 1e-3, 1e-6])
def test_the_wander_of_the_zero_is_fitted_for_strokes_of_any_length(identified, smaller):
    """Zeros are lengths and the waves of a wander are not: in metres, their columns differ by many decades."""
    (record,) = played(STAGE, (1.0,))
    slow = np.sin(np.pi * np.arange(record.size) / (2.0 * record.size))
    plain = identified.model.without("offset")
    scale = plain.displacement_scale
    record = replace(record, displacement=smaller * (plain.simulate(record)[0] + 0.005 * scale * slow))
    model = replace(plain, displacement_scale=smaller * scale)
    floor = smaller * STAGE.noise * STAGE.stroke
    matrices, weights = linearised(model, pieces_of([record], (0,)), [floor], ())
    fit = PieceFit(model, (), matrices, weights)
    span = WANDER * np.sqrt(2.0 * record.duration / WANDER_TIME) / (0.5 * np.pi)
    assert fit.slow[1] * span == pytest.approx(0.005, rel=0.02)


def test_a_rest_is_no_loop_that_could_be_left_out():
    u = np.concatenate((np.zeros(600), growing_sine(10.0, PERIOD, hold=0.0) - 5.0))
    rest, loops = Nanopositioner().play(u, PERIOD).split(600)
    kinds = [p.kind for p in pieces_of([rest, loops], [0, 1])]
    assert kinds[0] is Kind.HOLD
    assert set(kinds[1:]) == {Kind.LOOP}


@pytest.mark.parametrize(("frequency", "percent"), [pytest.param(1040.0, 0.1, marks=pytest.mark.soak), (1400.0, 0.2)])
def test_a_fast_mode_is_resolved_up_to_near_half_the_sampling_rate(frequency, percent):
    """Half the sampling rate is 1667 Hz: the nearer the mode, the less of its form is left in the samples."""
    fast = Nanopositioner(mode=frequency, delay=2e-4, pole=2e-4)
    records = [fast.play(growing_sine(f, 3e-4, (0.5, 1.0), hold=0.2), 3e-4, f"sine_{f:g}hz") for f in (2.0, 100.0)]
    model = identify(Experiment(tuple(records)), memory=True).model
    assert model[ExtraResonance.name]["f0"] == pytest.approx(frequency, rel=0.01)
    unseen = Experiment((fast.play(growing_sine(40.0, 3e-4, (0.5, 1.0), hold=0.2), 3e-4, "sine_40hz"),))
    assert max(percents(model, unseen)) < percent


def test_a_gain_that_rises_with_the_frequency_shows_a_mode_without_a_step():
    stage = Nanopositioner(mode=700.0, zeta=0.05, delay=2e-4, pole=1e-4)

    def smooth(frequency):
        time = 2e-4 * np.arange(round(3.0 / (frequency * 2e-4)))
        return 4.9 * (1.0 - np.cos(2.0 * np.pi * frequency * time)) * np.minimum(1.0, 0.4 + 0.3 * frequency * time)

    def record(frequency):
        return stage.play(smooth(frequency), 2e-4, f"sine_{frequency:g}hz")

    found = identify(Experiment((record(2.0), record(100.0))), memory=True)
    (notice,) = (n for n in found.notices if n.kind == "ringing")
    assert "the gain changes with the frequency" in notice.message
    assert not any(n.startswith(ExtraResonance.name) for n in found.fit.names)  # no interval of what was assumed
    assert max(percents(found.model, Experiment((record(50.0),)))) < 0.3


def test_a_staircase_shows_creep_and_the_ringing_of_its_steps():
    """Its step response repeats; dynamics of high order fitted to it take the place of creep."""
    levels = np.linspace(0.0, 10.0, 21)
    drive = np.repeat(np.concatenate((levels, levels[-2::-1])), 200)
    found = identify(Experiment((STAGE.play(drive, PERIOD, "staircase"),)), memory=True)
    assert found.fit.converged
    assert {"creep", "creep_two_rates"} & {e.name for e in found.model.effects}
    assert found.model[ExtraResonance.name]["f0"] == pytest.approx(STAGE.mode, rel=0.01)
    assert max(percents(found.model, played(STAGE, (1.0, 10.0)))) < 0.3


def test_the_effects_beside_the_operator_are_not_those_beside_plays():
    """Plays describe a stage of the published form so badly that its creep is below their error."""
    stage = Model((BoucWen(), Creep(gamma=0.01), Arx(a=(-0.5,), b=(0.5,), delay=1.0)), 1e-3, 10.0, 1e-5)
    time, rng = 1e-3 * np.arange(6000), np.random.default_rng(0)
    drives = (5.0 - 4.0 * np.cos(2.0 * np.pi * f * time) for f in (0.5, 5.0, 20.0))
    still = [Record(u, np.zeros(u.size), 1e-3, "sine") for u in (*drives, np.interp(time, (0, 3, 6), (0, 10, 0)))]
    moved = stage.free_run(still)
    noisy = [replace(r, displacement=y + 3e-9 * rng.normal(size=y.size)) for r, y in zip(still, moved, strict=True)]
    found = identify(Experiment(tuple(noisy)), memory=True)
    assert HysteresisMemory.name not in found.model and Creep.name in found.model
    low, high = found.fit.interval("creep.gamma")
    assert low < 0.01 < high
    check_reason(found)
    assert found.structure.leads[Creep.name] > 1.0
    assert HysteresisMemory.name not in found.structure.leads
