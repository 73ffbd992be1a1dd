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

"""The noise of a measured voltage is found and removed; a commanded or random drive is left as it is."""

from dataclasses import replace

import numpy as np
import pytest
import scipy

from benchmarks.nanopositioner import Nanopositioner, growing_sine
from piezo_hysteresis.effects import Arx, BoucWen, ExtraResonance
from piezo_hysteresis.identification.free_run_error import errors, free_per_record
from piezo_hysteresis.identification.identify import identify
from piezo_hysteresis.identification.records.comparable import comparable
from piezo_hysteresis.identification.records.excitation_content import excitation_content
from piezo_hysteresis.identification.records.noise import VOLTAGE_NOISE, quieted, voltage_noise
from piezo_hysteresis.model.model import Model
from piezo_hysteresis.record import Experiment, Record

PERIOD = 5e-4


def measured(record, noise, seed=0):
    random = np.random.default_rng(seed)
    return replace(record, voltage=record.voltage + noise * random.standard_normal(record.size))


@pytest.mark.parametrize("noise", [1e-4, 1e-3])
def test_a_measured_voltage_has_noise_and_a_commanded_one_has_none(noise):
    random = np.random.default_rng(0)
    t = 1e-3 * np.arange(4000)
    drives = (np.zeros(t.size), 8.0 * np.abs(t % 1.0 - 0.5), np.repeat([0.0, 3.0, 6.0, 2.0], 1000), np.sin(300.0 * t))
    commanded = [Record(u, 1e-6 * u, 1e-3) for u in drives]
    noisy = [measured(r, noise, random) for r in commanded]
    assert not voltage_noise(commanded).any()
    assert not voltage_noise(commanded[3:]).any()
    assert voltage_noise(noisy) == pytest.approx(noise, rel=0.1)
    averaged = [noisy[0], noisy[1].decimate(16)]
    assert voltage_noise(averaged) == pytest.approx([noise, noise / 4.0], rel=0.2)


@pytest.mark.parametrize("least", [0.02, 1.0])
def test_a_random_drive_is_no_noise(least):
    drive = 5.0 + least * np.random.default_rng(2).standard_normal(4000)
    record = Record(drive, 1e-6 * drive, 1e-3, initial_voltage=4.5)
    assert not voltage_noise([record]).any()
    assert excitation_content(record).is_broadband


def test_the_noise_of_a_drive_is_removed_and_its_motion_kept():
    noise, t = 1e-3, 1e-4 * np.arange(40_000)
    drive = 8.0 * np.abs(t % 1.0 - 0.5)
    noisy = measured(Record(drive, 1e-6 * drive, 1e-4), noise)
    quiet = quieted(noisy, noise).voltage

    def way(u):
        return np.abs(np.diff(u)).sum()

    assert np.abs(quiet - drive).max() < 8.0 * noise
    assert way(noisy.voltage) > 1.05 * way(drive)
    assert way(quiet) == pytest.approx(way(drive), rel=0.01)


@pytest.mark.parametrize(("frequency", "left"), [(1.0, 0.4), (10.0, 0.7)])
@pytest.mark.parametrize("triangle", [False, True])
def test_a_quiet_drive_is_nearer_to_the_true_one_and_its_step_stays(frequency, left, triangle):
    noise, drive = 0.01, growing_sine(frequency, PERIOD, (0.4, 1.0), triangle=triangle)
    quiet = quieted(measured(Record(drive, 1e-6 * drive, PERIOD, initial_voltage=0.0), noise), noise)
    assert np.std(quiet.voltage - drive) < left * noise
    assert np.abs(quiet.voltage - drive).max() < 8.0 * noise
    held = quiet.voltage[: round(0.4 / PERIOD) - 10]
    assert np.ptp(held) < 3.0 * noise
    assert np.std(held) < 0.3 * noise


def test_a_fast_random_drive_is_not_smoothed():
    """It lost its peaks: a loop of 48 µm was predicted 0.3 % of the range beside the stage, with 4 mV of noise."""
    noise, size = 4e-3, 40_000
    random = np.random.default_rng(3)
    fast = scipy.signal.lfilter(*scipy.signal.butter(4, 0.3), random.standard_normal(size))
    drive = np.concatenate((np.full(2000, 1.0), 1.0 + fast / fast.std(), np.full(2000, 1.0)))
    quiet = quieted(measured(Record(drive, 1e-6 * drive, 2e-5, initial_voltage=1.0), noise), noise).voltage
    assert np.std((quiet - drive)[3000:-3000]) < 1.02 * noise
    assert np.std((quiet - drive)[:1500]) < 0.2 * noise


@pytest.mark.parametrize("seed", range(4))
def test_the_noise_of_a_fast_random_drive_takes_no_memory_of_a_loop(seed):
    """It turned the loop of the model by up to 1.9 times itself: a backlash of half its size was named."""
    noise, random = 4e-3, np.random.default_rng(seed)
    fast = scipy.signal.lfilter(*scipy.signal.butter(2, 0.3), random.standard_normal(12_000))
    rise = np.linspace(0.0, 4.0, 2000)
    drive = np.concatenate((rise, 4.0 + 0.12 * fast / fast.std(), rise[::-1]))
    record = Record(drive, 1e-6 * drive, 5e-5, initial_voltage=0.0)
    loop = BoucWen(A=-0.77, beta=4.6, gamma=-0.87, p1=-0.11, p2=2.2)
    model = Model((loop, Arx(a=(-0.9,), b=(0.1,))), 5e-5, 10.0, 1e-5)
    true, seen = model.simulate([record])[0], model.simulate([quieted(measured(record, noise, seed), noise)])[0]
    assert np.std(seen - true) < 0.7 * noise * np.ptp(true) / np.ptp(drive)


def test_a_white_drive_keeps_its_turns():
    noise, drive = 4e-3, np.random.default_rng(0).normal(0.0, 0.03, 20_000)
    noisy = measured(Record(drive, 1e-6 * drive, 5e-5, initial_voltage=0.0), noise)
    assert np.array_equal(quieted(noisy, noise).voltage, noisy.voltage)


@pytest.mark.parametrize("seed", range(4))
def test_a_held_level_is_still_from_its_first_sample_to_its_last(seed):
    """Spikes stayed where the noise was largest, and each shook the loop of the model: effects were named for it."""
    drive, noise = np.zeros(20_000), 8e-3
    quiet = quieted(measured(Record(drive, drive, 2e-5, initial_voltage=0.0), noise, seed), noise).voltage
    assert np.abs(np.diff(quiet)).sum() < 10.0 * noise
    assert np.abs(quiet).max() < 1.5 * noise


@pytest.mark.soak
def test_identification_with_a_noisy_voltage_predicts_other_rates():
    stage = Nanopositioner(noise=2e-4)
    drives = {f: growing_sine(f, PERIOD, (0.4, 0.7, 1.0)) for f in (1.0, 10.0, 60.0)}
    played = {f: stage.play(u, PERIOD, f"sine_{f:g}hz") for f, u in drives.items()}
    noisy = Experiment(tuple(measured(played[f], 0.01) for f in (1.0, 60.0)))
    found = identify(noisy, memory=True)
    assert VOLTAGE_NOISE in {n.kind for n in found.notices}
    assert ExtraResonance in {type(e) for e in found.model.effects}
    unseen = errors(found.model, Experiment((played[10.0],)), free_per_record(found.model, offset=True))
    assert unseen.percent < 0.2
    again = errors(found.model, comparable(noisy)[0], free_per_record(found.model, offset=True))
    assert again.percent == pytest.approx(found.free_run_percent, rel=0.05)
