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

"""A lightly damped mode is found wherever the drive excites it: the turns of a triangle make it ring as steps do."""

import re

import numpy as np
import pytest
from scipy.signal import sawtooth

from benchmarks.nanopositioner import Nanopositioner, growing_sine
from piezo_hysteresis.effects import Arx, BoucWen
from piezo_hysteresis.identification.free_run_error import errors, free_per_record
from piezo_hysteresis.identification.identify import identify
from piezo_hysteresis.identification.structure.mode import mode_notices
from piezo_hysteresis.identification.structure.piece_fit import PieceFit
from piezo_hysteresis.model.model import Model
from piezo_hysteresis.record import Experiment, Record

PERIOD = 5e-4


def triangle(frequency, cycles=4):
    """A triangle from 0 V to 10 V that begins at rest."""
    t = np.arange(round(cycles / (frequency * PERIOD))) * PERIOD
    return 5.0 * (1.0 + sawtooth(2.0 * np.pi * frequency * t, 0.5))


def test_a_stage_that_only_lags_after_sharp_turns_is_not_said_to_ring():
    """A mode with a damping ratio of 0.7 to 1 describes the lag of a stage without a mode, but nothing rings."""
    stage = Nanopositioner(mode=8000.0, zeta=0.0125, pole=1e-4, delay=4e-4)
    found = identify(Experiment(tuple(stage.play(triangle(f), PERIOD) for f in (2.0, 10.0, 40.0))), memory=True)
    assert not any(n.kind == "ringing" and "rings" in n.message for n in found.notices)
    other = stage.play(triangle(20.0), PERIOD)
    error = (other.displacement - found.model.simulate(other)[0])[100:]
    assert np.std(error) < 1e-3 * np.ptp(other.displacement)


def test_a_mode_that_only_triangles_excite_is_fitted_and_named():
    stage = Nanopositioner(mode=337.0, zeta=0.0125, pole=1e-4, delay=4e-4)
    played = tuple(stage.play(triangle(f), PERIOD) for f in (2.0, 10.0, 40.0))
    found = identify(Experiment(played), memory=True)
    mode = found.model["extra_resonance"]
    assert abs(mode["f0"] - 337.0) < 3.0
    assert abs(mode["zeta"] - 0.0125) < 0.005
    assert any(n.kind == "ringing" for n in found.notices)
    other = stage.play(triangle(20.0), PERIOD)
    error = (other.displacement - found.model.simulate(other)[0])[100:]
    assert np.std(error) < 3e-3 * np.ptp(other.displacement)


def test_loops_that_ring_do_not_hide_the_hysteresis():
    """The ringing of fast triangles was taken for a loop without loss, which no joint fit left: errors of 3 %."""
    random, sigma = np.random.default_rng(4), 4e-9
    pole = np.exp(2.0 * np.pi * 300.0 * PERIOD * (-0.018 + 1j))
    poles = np.real(np.poly([pole, pole.conj()]))
    dynamics = Arx(a=tuple(poles[1:]), b=tuple(np.array([0.55, 0.45]) * poles.sum()), delay=37.0)
    loop = BoucWen(A=0.584, beta=3.85, gamma=1.81, p1=-0.087, p2=1.33)
    truth = Model((loop, dynamics), PERIOD, 10.0, 4e-5)
    noise = np.clip(random.normal(size=3000), -2.5, 2.5)
    ramp = np.linspace(0.0, 5.0, 300)
    drives = {
        "step": np.repeat([0.0, 2.0, 0.0], 40),
        "noise": np.concatenate((ramp, np.full(500, 5.0), 5.0 + 0.2 * noise, ramp[::-1])),
        "triangle": np.concatenate([share * triangle(20.0) for share in (0.25, 0.5, 0.75, 1.0)]),
        "sine_15hz": 4.5 * (1.0 - np.cos(2.0 * np.pi * 15.0 * PERIOD * np.arange(400))),
        "validation": 3.0 * (1.0 - np.cos(2.0 * np.pi * 100.0 * PERIOD * np.arange(200))),
    }
    played = [
        Record(u, truth.simulate(u) + sigma * random.normal(size=u.size), PERIOD, name) for name, u in drives.items()
    ]
    found = identify(played, voltage_scale=10.0, displacement_scale=4e-5, gain=1.0)
    for name, value in loop.values.items():
        low, high = found.fit.interval(f"bouc_wen.{name}", 3.0)
        assert low < value < high
    assert found.free_run_error < 1.5 * sigma
    assert not [n for n in found.notices if n.severe or n.kind == "at_bound"]


@pytest.mark.soak
@pytest.mark.parametrize("share", [0.06, 0.3])
def test_two_modes_are_described_at_a_rate_left_out(share):
    """The stage rings at 400 and 650 Hz; without the second mode, the error is up to 0.8 % of the range."""
    stage = Nanopositioner(mode=400.0, zeta=0.02, second_share=share, second_mode=650.0)
    drives = {f: growing_sine(f, PERIOD) for f in (1.0, 10.0, 60.0)}
    played = {f: stage.play(u, PERIOD, f"sine_{f:g}hz") for f, u in drives.items()}
    found = identify(Experiment((played[1.0], played[60.0])), memory=True)
    assert errors(found.model, Experiment((played[10.0],)), free_per_record(found.model, offset=True)).percent < 0.1
    assert found.model["extra_resonance"]["f0"] == pytest.approx(400.0, abs=2.0)
    (said,) = (n.message for n in found.notices if n.kind == "ringing")
    second = float(re.search(r"one at ([0-9.]+) Hz", said)[1])
    assert second == pytest.approx(650.0, abs=5.0)


def test_one_mode_is_not_taken_for_two():
    stage = Nanopositioner(mode=769.0, zeta=0.043, pole=2e-4)
    played = tuple(stage.play(growing_sine(f, PERIOD), PERIOD, f"sine_{f:g}hz") for f in (1.0, 10.0))
    (said,) = (n.message for n in identify(Experiment(played), memory=True).notices if n.kind == "ringing")
    assert "one at" not in said


@pytest.mark.soak
@pytest.mark.parametrize(
    ("mode", "delay", "fitted", "judged"),
    [
        (1284.0, 2.3e-4, (1.0,), 60.0),
        (1477.0, 5.4e-5, (1.0, 60.0), 10.0),
        (1860.0, 2.3e-4, (1.0,), 60.0),
        (1441.0, 6e-5, (1.0, 60.0), 10.0),
    ],
)
def test_samples_that_ring_at_another_frequency_than_the_stage_are_given_no_mode(mode, delay, fitted, judged):
    """Of 1284 Hz, samples every 0.5 ms show 716 Hz. A mode of 716 Hz that moves against the drive was stated.

    Of 1477 Hz, they show 523 Hz. A mode of this frequency needs more poles, and no delay beside a held drive.
    """
    stage = Nanopositioner(mode=mode, zeta=0.017, pole=1e-6, delay=delay)
    played = {f: stage.play(growing_sine(f, PERIOD), PERIOD, f"sine_{f:g}hz") for f in (1.0, 10.0, 60.0)}
    found = identify(Experiment(tuple(played[f] for f in fitted)), memory=True)
    assert "extra_resonance" not in found.model
    (said,) = (n.message for n in found.notices if n.kind == "ringing")
    told = [float(f) for f in re.findall(r"([0-9.]+) Hz", said)]
    assert any(f == pytest.approx(mode, rel=0.01) for f in told)
    free = free_per_record(found.model, offset=True)
    assert errors(found.model, Experiment((played[judged],)), free).percent < 0.1


def test_the_frequency_that_is_told_is_that_of_the_pole_that_moves_the_stage():
    """A stage that rings at 900 Hz was said to ring at 4029 Hz, from a pole with a millionth of a step."""
    period, damped = 1e-4, np.array([[900.0, 0.033], [4000.0, 0.001]])
    poles = np.exp(2e-4 * np.pi * damped[:, 0] * (-damped[:, 1] + 1j * np.sqrt(1.0 - damped[:, 1] ** 2)))
    mode, weak = (np.real(np.poly([p, p.conj()])) for p in poles)
    numerator = mode.sum() * (weak + 1e-6)  # nearly cancels the weak pole
    arx = Arx(a=tuple(np.convolve(mode, weak)[1:]), b=tuple(numerator), delay=1.0)
    (said,) = mode_notices(PieceFit(Model((BoucWen(), arx), period), (), np.zeros((0, 1, 1)), np.zeros(0)))
    assert "they ring at 900 Hz;" in said.message
