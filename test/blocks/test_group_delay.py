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

"""Poles, delays and the second mode against scipy, and their lag at every sample period."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import signal

from piezo_hysteresis.effects import (
    AmplifierBandwidth,
    Discretisation,
    Effect,
    ExtraDelay,
    ExtraResonance,
    SensorBandwidth,
)
from piezo_hysteresis.errors import ParameterError

PERIOD = 2e-5


def run(effect: Effect, x: np.ndarray, period: float = PERIOD) -> np.ndarray:
    block = effect.block(Discretisation(period, PERIOD))
    return block.run(x, block.rest(x[0], 0.0))[0]


def drive(n: int = 3000) -> np.ndarray:
    x = np.random.default_rng(5).normal(size=n).cumsum() * 0.01
    return x - x[0]


@pytest.mark.parametrize("tau", [3e-6, 4e-5, 2e-3])
def test_a_pole_is_exact_for_a_drive_linear_between_samples(tau: float) -> None:
    x = drive()
    _, expected, _ = signal.lsim(([1.0], [tau, 1.0]), x, np.arange(x.size) * PERIOD)
    np.testing.assert_allclose(run(AmplifierBandwidth(tau=tau), x), expected, atol=1e-10)


def test_equal_poles_in_a_row_are_single_poles_in_a_row() -> None:
    one, three = SensorBandwidth(tau=5e-5), SensorBandwidth(tau=5e-5, poles=3)
    x = drive()
    np.testing.assert_allclose(run(three, x), run(one, run(one, run(one, x))), atol=1e-13)


def test_a_half_pole_is_refused() -> None:
    with pytest.raises(ParameterError, match="whole number"):
        SensorBandwidth(poles=1.5)


@pytest.mark.parametrize("ratio", [1, 3, 40, 1000])
@pytest.mark.parametrize(
    "effect",
    [AmplifierBandwidth(tau=5e-5), SensorBandwidth(tau=2.5e-5, poles=2), ExtraDelay(tau=5e-5)],
    ids=lambda e: e.name,
)
def test_a_ramp_lags_by_the_same_time_at_every_sample_period(effect: Effect, ratio: int) -> None:
    t = np.arange(100) * PERIOD * ratio
    np.testing.assert_allclose(run(effect, t, PERIOD * ratio)[50:], t[50:] - 5e-5, rtol=1e-9)


@pytest.mark.parametrize("samples", [0.3, 1.0, 1.6, 4.25])
def test_a_delay_moves_a_cubic_by_that_time(samples: float) -> None:
    t = np.arange(60.0)
    cubic = 1e-3 * t**3 - 0.02 * t**2 + t
    moved = t[10:] - samples
    expected = 1e-3 * moved**3 - 0.02 * moved**2 + moved
    np.testing.assert_allclose(run(ExtraDelay(tau=samples * PERIOD), cubic)[10:], expected, rtol=1e-10)


@pytest.mark.parametrize(("f0", "zeta"), [(300.0, 0.01), (2000.0, 0.3), (300.0, 1.0)])
def test_the_extra_mode_is_that_of_scipy(f0: float, zeta: float) -> None:
    x, rate = drive(), 2 * np.pi * f0
    _, mode, _ = signal.lsim(([rate**2], [1.0, 2 * zeta * rate, rate**2]), x, np.arange(x.size) * PERIOD)
    np.testing.assert_allclose(run(ExtraResonance(r=0.4, f0=f0, zeta=zeta), x), 0.6 * x + 0.4 * mode, atol=1e-9)


def test_a_mode_faster_than_the_samples_is_its_lag() -> None:
    t = np.arange(50) * 1e-2
    y = run(ExtraResonance(r=0.5, f0=500.0, zeta=0.1), t, 1e-2)
    np.testing.assert_allclose(y[5:], t[5:] - 0.5 * 2 * 0.1 / (2 * np.pi * 500.0), rtol=1e-9)
