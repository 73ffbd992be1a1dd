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

"""How a diagnosis prepares the records and uses a given model."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.nanopositioner import Nanopositioner, growing_sine
from piezo_hysteresis.discrepancy import diagnose
from piezo_hysteresis.discrepancy.diagnose import GIVEN_DIVERGES, RESAMPLED
from piezo_hysteresis.discrepancy.verdict import Conclusion, Verdict
from piezo_hysteresis.effects import Arx, BoucWen, ExtraDelay, ExtraResonance, Softening
from piezo_hysteresis.errors import DivergenceError
from piezo_hysteresis.identification.identify import identify
from piezo_hysteresis.model.model import Model
from piezo_hysteresis.record import Experiment, Record

PERIOD = 5e-4
STAGE = Nanopositioner(mode=310.0, delay=2e-4, pole=2e-4)


def played(stage, period, frequencies):
    drives = ((f"sine_{f:g}hz", growing_sine(f, period, (0.4, 0.7, 1.0))) for f in frequencies)
    return Experiment(tuple(stage.play(u, period, name) for name, u in drives))


@pytest.fixture(scope="module")
def model():
    return identify(played(STAGE, PERIOD, (1.0, 10.0, 60.0)), memory=True).model


@pytest.mark.parametrize("share", [0.5, pytest.param(0.3, marks=pytest.mark.soak)])
def test_faster_records_are_compared_with_the_given_model(model, share):
    another_day = STAGE.on_another_day(np.random.default_rng(5))
    same = diagnose(played(another_day, share * PERIOD, (1.0, 10.0, 60.0)), model)
    assert [n.kind for n in same.experiment.notices].count(RESAMPLED) == 1
    assert same.verdict is not Verdict.NAMED
    later = diagnose(played(replace(another_day, filter_pole=2e-3), share * PERIOD, (1.0, 10.0, 60.0)), model)
    assert later.conclusion is Conclusion.CHANGED_PARAMETER
    (effect,) = later.effects()
    assert effect["family"] == "lag" and effect["parameters"]["tau"]["value"] == pytest.approx(2e-3, rel=0.05)


@pytest.mark.parametrize("frequencies", [(1.0, 60.0), pytest.param((1.0, 5.0, 10.0, 60.0), marks=pytest.mark.soak)])
def test_a_given_model_that_diverges_is_replaced_by_an_identified_one(frequencies):
    experiment = played(STAGE, PERIOD, frequencies)
    unstable = Model((BoucWen(), Arx(a=(-1.58, 0.79), b=(0.21,)), Softening(k3=-1.0)), PERIOD, 2.0, 1e-5)
    with pytest.raises(DivergenceError):
        unstable.free_run(experiment)
    found = diagnose(experiment, unstable)
    assert [n.kind for n in found.experiment.notices].count(GIVEN_DIVERGES) == 1
    assert found.gap.after < 0.5


def test_the_mode_that_a_given_model_without_dynamics_lacks_is_named():
    """The command ended with "got no effect 'arx'", after a minute."""
    period, size, rng = 1e-3, 3000, np.random.default_rng(0)
    bare = Model((BoucWen(),), period, 10.0, 1e-5)
    a = np.poly(np.exp(period * 2.0 * np.pi * 60.0 * np.array([-0.05 + 1j, -0.05 - 1j]))).real
    stage, time = bare.with_effect(Arx(a=a[1:], b=(a.sum(),))), period * np.arange(size)
    drives = {f"noise_{k}": np.clip(5.0 + 1.5 * rng.normal(size=size), 0.0, 10.0) for k in range(2)}
    drives |= {f"sine_{f:g}hz": 5.0 - v * np.cos(2.0 * np.pi * f * time) for v, f in ((4, 1), (2, 5), (4, 20))}
    records = [Record(u, np.zeros(size), period, name) for name, u in drives.items()]
    answers = zip(records, stage.simulate(records), strict=True)
    measured = [replace(r, displacement=y + 2e-9 * rng.normal(size=size)) for r, y in answers]
    found = diagnose(Experiment(tuple(measured)), bare, effects=[ExtraDelay, ExtraResonance])
    assert "extra_resonance" in found.names
    assert found.model["extra_resonance"]["f0"] == pytest.approx(60.0, rel=0.01)


@pytest.mark.parametrize(("period", "frequencies"), [(1e-4, (1.0, 5.0, 20.0, 60.0)), (5e-5, (1.0, 10.0, 60.0))])
def test_a_step_at_the_beginning_of_a_long_record_is_not_averaged(period, frequencies):
    pole = np.exp(-period / 1.4e-3)
    truth = Model((BoucWen(), Arx(a=(-pole,), b=(1.0 - pole,))), period, 2.0, 1e-5)
    rng = np.random.default_rng(0)
    records = []
    for name, drive in ((f"sine_{f:g}hz", growing_sine(f, period, (0.4, 0.7, 1.0))) for f in frequencies):
        record = Record(drive, np.zeros(drive.size), period, phase=name, initial_voltage=0.0)
        noise = 2e-8 * rng.normal(size=drive.size)
        records.append(replace(record, displacement=truth.free_run([record])[0] + noise))
    found = diagnose(Experiment(tuple(records)), truth)
    assert found.selection.score.excess == pytest.approx(1.0, abs=0.1)
    assert found.verdict is Verdict.NOTHING_MISSING or len(frequencies) < 4
    assert found.gap.after <= found.gap.before


def test_effects_whose_start_values_are_beyond_their_bounds_are_left_out():
    """A drive of millivolts, as from a wrong unit, ended the diagnosis: 'hysteresis_memory.reach: got 0.0005'."""
    given = Model((BoucWen(), Arx(b=(1.0,))), 0.1, 10.0, 1e-5)
    t = given.sample_period * np.arange(400)
    drive = 5e-3 * (1.0 - np.cos(0.1 * np.pi * t))
    measured = given.simulate(drive) + 2e-10 * np.sin(0.9 * t)
    assert diagnose([Record(drive, measured, given.sample_period)], given).verdict is not Verdict.NAMED


@pytest.mark.soak
def test_the_share_of_an_effect_is_not_that_of_a_resonance_that_moved():
    """Plays were said to explain 98 % of the gap, most of which was a resonance 10 % lower than before."""
    noise = 5.0 + np.clip(np.random.default_rng(1).normal(0.0, 1.0, 6000), -4.0, 4.0)
    up = np.linspace(0.0, 10.0, 1500)
    drives = {
        "noise": noise,
        "triangle": np.concatenate((up, up[::-1], 0.6 * up, 0.6 * up[::-1])),
        "step": np.repeat([3.0, 8.0, 5.0, 9.0, 1.0, 6.0], 800),
        "sine": growing_sine(5.0, PERIOD, (0.4, 1.0)),
        "validation": growing_sine(30.0, PERIOD, (0.5, 0.9), cycles=8),
    }
    before = Nanopositioner(mode=420.0, zeta=0.06, creep_fast=0.012, creep_slow=0.012)
    days = before, replace(before, mode=378.0, noise_seed=4)
    first, second = (Experiment(tuple(day.play(u, PERIOD, n) for n, u in drives.items())) for day in days)
    found = diagnose(second, identify(first).model)
    of_no_model = diagnose(second)
    assert found.conclusion is Conclusion.MISSING_EFFECT
    assert found.gap.before > 5.0 * of_no_model.gap.before
    (share,) = {e["explained_fraction"] for e in of_no_model.effects()}
    assert all(e["explained_fraction"] == pytest.approx(share, abs=0.1) for e in found.effects())
    assert f"{100 * found.gap.explained:.0f} %" not in found.reason
