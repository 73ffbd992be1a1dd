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

"""Swapped channels are found in noise and in slow loops, and no stage of the tests is called swapped."""

import numpy as np
import pytest
from scipy.signal import butter, lfilter

from piezo_hysteresis.record import Experiment, Record
from piezo_hysteresis.recording import inspect
from piezo_hysteresis.recording.checks.swapped import lead_in_band, loop_opening
from piezo_hysteresis.stage.plant import PlantParameters
from piezo_hysteresis.stage.simulated import SimulatedStage

FAST, SLOW = 2e-5, 1e-3


def white(rng):
    return np.clip(3.5 + 0.8 * rng.normal(size=16000), 0.0, 10.0)


def low_noise(rng):
    wave = lfilter(*butter(4, 2000.0 * 2.0 * FAST), rng.normal(size=16000))
    return 3.5 + 0.8 * wave / wave.std()


def chirp(rng):
    t = FAST * np.arange(16000)
    return 3.5 + 2.0 * np.sin(2.0 * np.pi * (10.0 * t + 1990.0 * t**2 / (2.0 * t[-1])))


def triangle(rng):
    return 6.0 - 5.0 * np.abs(2.0 * np.mod(SLOW * np.arange(8000), 1.0) - 1.0)


def growing(rng):
    return triangle(rng) * np.repeat(np.linspace(0.4, 1.0, 8), 1000)


def held(rng):
    return np.repeat(rng.uniform(0.0, 8.0, 12), 700)


def sine(rng):
    return 3.5 + 2.5 * np.sin(2.0 * np.pi * 3.0 * SLOW * np.arange(8000))


def fast_sine(rng):
    return 3.5 + 2.5 * np.sin(2.0 * np.pi * 150.0 * FAST * np.arange(16000))


DRIVES = [
    (fast_sine, FAST),
    (white, FAST),
    (low_noise, FAST),
    (chirp, FAST),
    (triangle, SLOW),
    (growing, SLOW),
    (sine, SLOW),
]
STAGES = [{}, {"creep.gamma": 0.02}, {"sensor.noise": 3e-3}]


def played(drive, period, values, seed=0):
    stage = SimulatedStage(PlantParameters().with_values(values), seed=seed, sample_period=period)
    return stage.play(drive(np.random.default_rng(seed)), "record")


def exchanged(record, gain=5e-6):
    return Record(record.displacement / gain, record.voltage * gain, record.sample_period, record.phase)


def leads(record):
    return [n for n in inspect(Experiment((record,))) if n.kind == "leads"]


@pytest.mark.parametrize("values", STAGES)
@pytest.mark.parametrize(("drive", "period"), DRIVES)
def test_swapped_channels_are_severe_and_the_right_ones_no_finding(drive, period, values):
    record = played(drive, period, values)
    assert not leads(record)
    (found,) = leads(exchanged(record))
    assert found.severe and "swapped" in found.message


@pytest.mark.parametrize("drive", [triangle, sine, held, white])
def test_a_stage_without_loop_and_without_lag_says_nothing(drive):
    voltage = drive(np.random.default_rng(1))
    noise = 1e-9 * np.random.default_rng(0).normal(size=voltage.size)
    record = Record(voltage, 5e-6 * voltage + noise, SLOW)
    assert not leads(record) and not leads(exchanged(record))


def test_the_opening_is_the_width_of_a_loop_and_its_sign_the_direction():
    voltage = triangle(None)
    way = 2.0 * (voltage - 3.5) / np.ptp(voltage)
    rising = np.mod(SLOW * np.arange(voltage.size), 1.0) < 0.5
    loop = np.where(rising, -1.0, 1.0) * 0.1 * (1.0 - way**2) * 0.5 * np.ptp(voltage)
    for sign in (1.0, -1.0):
        opening = loop_opening(Record(voltage, 1e-6 * (voltage + sign * loop), SLOW))
        assert opening == pytest.approx(0.1 * sign, rel=0.02)


def test_one_sample_is_no_lead_and_four_are():
    voltage = low_noise(np.random.default_rng(3))
    for shift in (1, 4):
        lead = lead_in_band(Record(voltage[:-shift], 1e-6 * voltage[shift:], FAST))
        expected = pytest.approx(shift * FAST, rel=0.05)
        assert lead is None or lead == expected
        assert bool(leads(Record(voltage[:-shift], 1e-6 * voltage[shift:], FAST))) == (shift == 4)


def test_a_zero_of_the_response_is_no_lead():
    pair = [np.exp(2.0 * np.pi * f * FAST * (-0.05 + 1j)) for f in (700.0, 1500.0)]
    zeros, poles = (np.real(np.poly([z, np.conj(z)])) for z in pair)
    voltage = low_noise(np.random.default_rng(2))
    displacement = 1e-6 * lfilter(zeros / zeros.sum() * poles.sum(), poles, voltage)
    assert not leads(Record(voltage[200:], displacement[200:], FAST))


@pytest.mark.parametrize("frequency", [60.0, 120.0, 190.0])
@pytest.mark.parametrize("mode", [20.0, 50.0, 100.0, 150.0])
@pytest.mark.parametrize("damping", [0.01, 0.1])
def test_a_sine_behind_a_resonance_is_no_lead(frequency, mode, damping):
    pole = np.exp(2.0 * np.pi * mode * FAST * (-damping + 1j * np.sqrt(1.0 - damping**2)))
    poles = np.real(np.poly([pole, np.conj(pole)]))
    voltage = 3.5 + 2.5 * np.sin(2.0 * np.pi * frequency * FAST * np.arange(40000))
    voltage = lfilter([0.01], [1.0, -0.99], voltage)  # an amplifier
    displacement = 1e-6 * lfilter([poles.sum()], poles, voltage)
    assert not leads(Record(voltage[20000:], displacement[20000:], FAST))
