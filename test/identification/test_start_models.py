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

"""The baseline begins wherever there are loops, whatever the broadband records show."""

import numpy as np
import pytest

from piezo_hysteresis.discrepancy.search import baseline_setup
from piezo_hysteresis.effects import Arx, BoucWen
from piezo_hysteresis.effects.extent import Extent
from piezo_hysteresis.errors import DivergenceError
from piezo_hysteresis.identification.fit.cross_validation import Score
from piezo_hysteresis.identification.fit.fit import Fit
from piezo_hysteresis.identification.fit.normal_equations import Linearised
from piezo_hysteresis.identification.records.noise_floor import noise_floors
from piezo_hysteresis.identification.start_models import exact, start_models
from piezo_hysteresis.identification.steps.linear_start import dynamics_of
from piezo_hysteresis.identification.training.model_score import Fitted
from piezo_hysteresis.identification.training.training_data import TrainingData
from piezo_hysteresis.model.model import Model
from piezo_hysteresis.record import Record

PERIOD = 1e-4


def test_noise_that_does_not_determine_the_sign_of_the_gain_gives_a_start():
    stage = Model((BoucWen(), Arx(a=(), b=(1.0,), delay=2.0)), PERIOD, 10.0, 1e-5)
    time = PERIOD * np.arange(20_000)
    voltage = (1.0 + 4.0 * np.floor(time)) * (1.0 - np.abs(2.0 * np.mod(time, 1.0) - 1.0))
    loops = Record(voltage, stage.simulate(Record(voltage, time, PERIOD))[0], PERIOD, "triangle")
    noise = np.random.default_rng(0).normal(size=20_000)
    backwards = Record(5.0 + noise, -1e-6 * np.roll(noise, 2), PERIOD, "noise")
    for start in start_models((loops, backwards), (0, 1)):
        assert dynamics_of(start).dc_gain > 0.0


def test_a_sensor_of_reversed_sign_has_a_negative_gain():
    """With a hysteresis that falls with the drive, no plays were found, and the answer was "unknown"."""
    stage = Model((BoucWen(), Arx(a=[-0.6], b=[0.4], delay=2.0)), PERIOD, 10.0, 1e-5)
    time = PERIOD * np.arange(10_000)
    voltage = 5.0 * (1.0 - np.abs(2.0 * np.mod(time, 1.0) - 1.0))
    noise = 5.0 + 0.1 * np.random.default_rng(0).normal(size=10_000)
    drives = {"triangle": voltage, "noise": noise}
    records = [Record(u, -stage.simulate(u), PERIOD, phase) for phase, u in drives.items()]
    for start in start_models(records, (0, 1)):
        assert dynamics_of(start).dc_gain == pytest.approx(-1.0)
        assert start.hysteresis["p2"] > 0.0


def test_a_stage_that_only_fast_drives_show_is_described_from_one_of_the_starts():
    """No record shows a static loop, and every fit ended as a relay, with V at 150 or more."""
    pole = np.exp(2.0 * np.pi * 900.0 * PERIOD * (-0.05 + 1j))
    a = np.real(np.poly([pole, pole.conj()]))
    loop = BoucWen(A=-0.45, beta=7.0, gamma=-1.5, p1=-0.1, p2=1.8)
    stage = Model((loop, Arx(a=tuple(a[1:]), b=(a.sum(),), delay=2.0)), PERIOD, 10.0, 1e-5)
    rng, records = np.random.default_rng(3), []
    for top in (1200.0, 800.0, 1200.0, 800.0):
        lines = rng.normal(size=2501) + 1j * rng.normal(size=2501)
        lines[np.arange(2501) > top / (1.0 / (5000 * PERIOD))] = 0.0
        wave = np.fft.irfft(lines)
        drive = 5.0 + 4.5 * wave / np.abs(wave).max()
        y = stage.simulate(Record(drive, drive, PERIOD, initial_voltage=0.0))[0]
        records.append(Record(drive, y + 1e-8 * rng.normal(size=y.size), PERIOD, "noise", initial_voltage=0.0))
    setup = baseline_setup.prepare_baseline(records, range(4), None, None, False, lambda word, part: None)
    assert setup.score.excess < 1.5


def test_a_start_from_which_the_fit_fails_hides_no_later_one(monkeypatch):
    first, second, third = (
        exact(Model((BoucWen(), Arx(a=(), b=(1.0,), delay=d)), PERIOD, 10.0, 1e-5)) for d in (1, 2, 3)
    )
    record = Record(np.arange(100.0), np.zeros(100), PERIOD)
    training_data = TrainingData((record,), np.ones(1), Extent.of([record], 10.0, 1e-5))

    def fitted(model, cost):
        return Fit(model, (), np.empty((0, 0)), cost, (), (), (), True, 1)

    def joint(start, *_, **__):
        if start is second:
            raise DivergenceError("arx", 0, 0.0)
        return fitted(start, 1.0)

    monkeypatch.setattr(baseline_setup, "joint", joint)
    perfect = Score(np.ones(4), np.zeros(1))
    monkeypatch.setattr(baseline_setup, "scored", lambda model, _: Fitted(model, perfect, Linearised((), ())))
    monkeypatch.setattr(baseline_setup, "score_model", lambda *_: perfect)
    poor = Score(np.full(4, 5.0), np.zeros(1))
    found = fitted(first, 25.0), poor
    for start in (second, third):
        found = baseline_setup.better_fit(start, *found, training_data)
    assert found[0].model is third


def test_the_floor_of_averages_is_that_of_the_same_data_recorded_at_that_rate():
    model = exact(Model((BoucWen(), Arx(a=(), b=(1.0,), delay=1)), PERIOD, 10.0, 1e-5))
    drive = 10.0 * (1.0 - np.abs(np.linspace(-1.0, 1.0, 18_000)))
    (moved,) = model.free_run([Record(drive, drive, 1e-3, "triangle")])
    noise = 3e-8 * np.random.default_rng(2).normal(size=(3, drive.size))
    records = [Record(drive, moved + e, 1e-3, "triangle") for e in noise]
    setup = baseline_setup.prepare_baseline(records, range(3), model, None, False, lambda word, part: None)
    averages = [records[i].decimate(3) for i in setup.fitted]
    assert [r.size for r in setup.training_data.records] == [r.size for r in averages]
    np.testing.assert_allclose(setup.training_data.floors, noise_floors(averages), rtol=1e-6)
    whole, _ = setup.for_last_fit()
    np.testing.assert_allclose(whole.floors, setup.least[list(setup.fitted)], rtol=1e-6)
    assert setup.training_data.null == whole.null == pytest.approx(1.0)
