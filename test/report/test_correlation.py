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

"""The residual tests fire when they should, at the rate they promise; one frequency decides nothing."""

import numpy as np
import pytest
from scipy.signal import correlate as scipy_correlate
from scipy.signal import lfilter

from piezo_hysteresis.effects import Arx, BoucWen, Creep
from piezo_hysteresis.errors import RecordError
from piezo_hysteresis.model.model import Model
from piezo_hysteresis.record import Record
from piezo_hysteresis.report.correlation import correlate

RANDOM = np.random.default_rng(7)


def test_equals_the_definition():
    e, u = RANDOM.normal(size=300), RANDOM.normal(size=300)
    found = correlate(e, u, 0.1, lags=20)
    e, u = e - e.mean(), u - u.mean()
    np.testing.assert_allclose(found.auto, scipy_correlate(e, e)[299:320] / (e @ e), atol=1e-12)
    np.testing.assert_allclose(found.cross, scipy_correlate(e, u)[279:320] / np.sqrt((e @ e) * (u @ u)), atol=1e-12)
    assert found.cross_lag[[0, -1]] == pytest.approx([-2.0, 2.0])


def test_bounds_are_valid_for_coloured_noise_independent_of_the_drive():
    alarms = 0
    for _ in range(300):
        e = lfilter([1.0], [1.0, -0.9], RANDOM.normal(size=4000))
        u = lfilter([1.0], [1.0, -0.8], RANDOM.normal(size=4000))
        alarms += not correlate(e, u, 1.0).is_independent
    assert alarms <= 9  # 1 % of 300, and three standard deviations


def test_white_noise_passes_and_coloured_noise_does_not():
    white = RANDOM.normal(size=4000)
    u = RANDOM.normal(size=4000)
    assert correlate(white, u, 1.0).is_white
    assert not correlate(lfilter([1.0], [1.0, -0.5], white), u, 1.0).is_white


def test_a_missing_lag_of_the_drive_shows_at_that_lag():
    u = RANDOM.normal(size=4000)
    e = RANDOM.normal(size=4000) + np.roll(u, 7) * 0.5
    found = correlate(e, u, 1e-3)
    assert found.cross_lag[np.argmax(np.abs(found.cross))] == pytest.approx(7e-3)
    assert abs(found.cross).max() > 5 * found.cross_bound


def test_one_frequency_does_not_decide():
    t = np.arange(4000) / 4000
    found = correlate(np.cos(2 * np.pi * 10 * t), np.sin(2 * np.pi * 10 * t), 1 / 4000)
    assert not found.decides
    assert found.is_independent


@pytest.mark.parametrize("levels", [(1.0,), (0.2, 0.4, 0.6, 0.8, 1.0)])
def test_harmonics_of_a_sine_above_the_noise_are_not_passed(levels):
    """The filter that makes the residual white removes what follows the drive, and a small correlation is left."""
    phase = 2 * np.pi * np.arange(4000) / 400
    drive = np.concatenate([level * np.sin(phase) for level in levels])
    noise = np.random.default_rng(3).normal(size=drive.size)
    memory = 60.0 * (drive**3 + np.roll(drive, 60) ** 2)  # 59 standard deviations of the noise and more
    found = correlate(noise + memory, drive, 2e-3)
    assert found.excitation_order == pytest.approx(2.0, abs=1.1)
    assert not found.decides


def test_a_white_residual_of_a_sine_passes():
    """Whatever follows one sine would colour the residual."""
    noise = np.random.default_rng(3).normal(size=4000)
    found = correlate(noise, np.sin(2 * np.pi * np.arange(4000) / 400), 2e-3)
    assert found.decides
    assert found.is_independent


@pytest.mark.parametrize(
    ("e", "u"), [(np.ones(50), np.arange(50.0)), (np.arange(50.0), np.ones(50)), (np.arange(9.0),) * 2]
)
def test_constant_or_short_signals_are_refused(e, u):
    with pytest.raises(RecordError, match="correlation"):
        correlate(e, u, 1.0)


@pytest.mark.parametrize("phase", ["staircase", "minor_loops"])
@pytest.mark.parametrize("gamma", [0.0, 0.015])
def test_a_model_without_creep_fails_on_slow_drives_too(phase, gamma):
    """The drive is slow and so is what is missing: only their innovations show that the one follows the other."""
    drive = {
        "staircase": np.repeat([0.0, 2.0, 5.0, 8.0, 5.0, 2.0, 0.0], 300),
        "minor_loops": np.interp(
            np.arange(4000), 100 * np.arange(41), np.random.default_rng(2).uniform(0.0, 8.0, 41).round(1)
        ),
    }[phase]
    plain = Model((BoucWen(), Arx(a=(), b=(1.0,), delay=1)), 1e-2, 10.0, 1e-5)
    (without,) = plain.simulate(Record(drive, np.zeros(drive.size), 1e-2))
    (creeping,) = plain.with_effect(Creep(gamma=gamma)).simulate(Record(drive, np.zeros(drive.size), 1e-2))
    left = creeping - without + 5e-4 * np.ptp(without) * np.random.default_rng(1).normal(size=drive.size)
    found = correlate(left, drive, 1e-2)
    assert found.decides
    assert found.cross_bound < 0.3
    assert found.is_independent is (gamma == 0.0)


@pytest.mark.parametrize("moving", [0, 16])
def test_a_ringing_after_a_step_before_the_first_sample_is_not_passed(moving):
    """The drive is constant while the residual rings; the motion of its last samples passed the test."""
    time = 1e-4 * np.arange(10_000)
    drive = np.full(time.size, 5.0)
    drive[time.size - 1 - moving :] += 1e-3 * np.arange(moving + 1)
    drive[-1] += 1e-3
    ringing = np.exp(-100.0 * time) * np.sin(2.0 * np.pi * 700.0 * time)
    found = correlate(ringing + 1e-3 * np.random.default_rng(1).normal(size=time.size), drive, 1e-4)
    assert not found.is_white
    assert not found.decides
