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

"""Limits of the amplifier."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from piezo_hysteresis.effects import (
    AmplifierBandwidthHeld,
    AmplifierSaturation,
    AmplifierSlewLimit,
    AmplifierSlewLimitHeld,
    AmplifierSlewLimitSettling,
    Discretisation,
    Effect,
)
from piezo_hysteresis.errors import ParameterError
from piezo_hysteresis.stage.plant.clock import Clock
from piezo_hysteresis.stage.plant.electronics import Amplifier, Electronics

PERIOD = 2e-5


def run(effect: Effect, x: np.ndarray) -> np.ndarray:
    block = effect.block(Discretisation(PERIOD, PERIOD))
    return block.run(x, block.rest(x[0], 0.0))[0]


def test_a_step_becomes_a_ramp_of_the_slew_limit() -> None:
    y = run(AmplifierSlewLimit(S=1000.0), np.append(1.0, np.full(399, 5.0)))
    np.testing.assert_allclose(y, np.minimum(1.0 + 1000.0 * PERIOD * np.arange(400), 5.0), rtol=1e-12)


@settings(max_examples=40)
@given(st.lists(st.floats(-10.0, 10.0), min_size=2, max_size=50), st.floats(1.0, 1e6))
def test_no_step_is_larger_than_the_limit_and_a_drive_inside_it_passes(x: list[float], slope: float) -> None:
    drive = np.array(x)
    y = run(AmplifierSlewLimit(S=slope), drive)
    assert np.abs(np.diff(y)).max() <= slope * PERIOD * (1 + 1e-9) + 1e-14
    if np.abs(np.diff(drive)).max() <= slope * PERIOD:
        np.testing.assert_array_equal(y, drive)


def test_a_held_slope_limit_gives_the_mean_of_the_ramps_in_every_period() -> None:
    finer, slope = 1000, 1e4
    drive = 3.0 + np.cumsum(np.random.default_rng(5).normal(0.0, 0.1, 400))
    drive[200:] += 2.0
    block = AmplifierSlewLimit(S=slope).block(Discretisation(PERIOD / finer, PERIOD / finer))
    ramps = block.run(np.repeat(drive, finer), block.rest(drive[0], 0.0))[0]
    means = ramps.reshape(-1, finer).mean(axis=1)
    assert np.abs(means - drive).max() > 1.0
    np.testing.assert_allclose(run(AmplifierSlewLimitHeld(S=slope), drive), means, atol=slope * PERIOD / finer)


def test_an_amplifier_with_a_pole_and_a_largest_slope_follows_its_differential_equation() -> None:
    """Explicit steps a thousandth as long as the period, of a drive that reaches the slope now and then."""
    finer, slope, tau = 1000, 1e4, 3e-5
    drive = 3.0 + np.cumsum(np.random.default_rng(6).normal(0.0, 0.3, 400))
    drive[200:] += 2.0
    y, expected = drive[0], []
    for held in drive:
        for _ in range(finer):
            y += np.clip((held - y) / tau, -slope, slope) * PERIOD / finer
        expected.append(y)
    found = run(AmplifierSlewLimitSettling(S=slope, tau=tau), drive)
    np.testing.assert_allclose(found, expected, atol=1e-4)
    in_series = (AmplifierSlewLimit(S=slope), AmplifierBandwidthHeld(tau=tau))
    for first, second in (in_series, in_series[::-1]):
        assert np.abs(run(second, run(first, drive)) - expected).max() > 0.03


@settings(max_examples=40)
@given(st.lists(st.floats(-10.0, 10.0), min_size=2, max_size=50), st.floats(1.0, 1e6), st.floats(1e-6, 1e-3))
def test_without_a_pole_or_a_limit_it_is_the_other_one(x: list[float], slope: float, tau: float) -> None:
    drive = np.array(x)
    limit, pole = AmplifierSlewLimit(S=slope), AmplifierBandwidthHeld(tau=tau)
    np.testing.assert_allclose(run(AmplifierSlewLimitSettling(S=slope), drive), run(limit, drive), atol=1e-12)
    np.testing.assert_allclose(run(AmplifierSlewLimitSettling(tau=tau), drive), run(pole, drive), atol=1e-12)


@pytest.mark.parametrize("ratio", [1, 3, 40])
def test_behind_a_held_slope_limit_the_lag_is_proportional_to_the_speed(ratio: int) -> None:
    """In slow records, too: half the time that the amplifier needs for the step within one period of the model."""
    speed, slope, t = -300.0, 2e3, np.arange(100) * PERIOD * ratio
    block = AmplifierSlewLimitHeld(S=slope).block(Discretisation(PERIOD * ratio, PERIOD))
    y = block.run(speed * t, block.rest(0.0, 0.0))[0]
    np.testing.assert_allclose(y[1:], speed * (t[1:] - 0.5 * abs(speed) * PERIOD / slope), rtol=1e-6)


def test_saturation_clips_hard_without_corner() -> None:
    x = np.linspace(-5.0, 12.0, 300)
    y = run(AmplifierSaturation(lower=-1.0, upper=10.0, corner=0.0), x)
    np.testing.assert_allclose(y, np.clip(x, -1.0, 10.0), atol=1e-14)


@settings(max_examples=40)
@given(st.floats(0.0, 2.0), st.floats(5.0, 10.0), st.floats(0.01, 2.0))
def test_a_corner_is_smooth_monotonic_and_ends_at_the_limits(lower: float, upper: float, corner: float) -> None:
    x = np.linspace(-8.0, 18.0, 20001)
    y = run(AmplifierSaturation(lower=lower, upper=upper, corner=corner), x)
    slope = np.diff(y) / np.diff(x)
    assert (slope > -1e-9).all()
    assert (slope < 1 + 1e-9).all()
    assert np.abs(np.diff(slope)).max() < 1.1 * np.diff(x)[0] / (2 * corner)
    assert y[0] == pytest.approx(lower, abs=1e-12)
    assert y[-1] == pytest.approx(upper, abs=1e-12)
    inside = (x > lower + corner) & (x < upper - corner)
    np.testing.assert_array_equal(y[inside], x[inside])


def test_crossed_limits_are_refused() -> None:
    with pytest.raises(ParameterError, match="expected lower < upper"):
        AmplifierSaturation(lower=5.0, upper=1.0)


@pytest.mark.parametrize("bandwidth", [1e3, 1e4, 5e4])
def test_a_held_pole_is_the_amplifier_at_the_ends_of_the_holds(bandwidth: float) -> None:
    clock = Clock.cut(PERIOD, 0.0, PERIOD / 7.0)
    drive = np.random.default_rng(3).normal(5.0, 1.0, 500)
    amplifier = Amplifier(Electronics(amplifier_bandwidth=bandwidth, delay=0.0), clock, drive[0])
    ends = amplifier.run(drive)[clock.count - 1 :: clock.count]
    np.testing.assert_allclose(run(AmplifierBandwidthHeld(tau=1 / (2 * np.pi * bandwidth)), drive), ends, atol=1e-12)


@pytest.mark.parametrize("ratio", [1, 3, 40, 1000])
def test_a_held_pole_lags_by_the_same_time_at_every_sample_period(ratio: int) -> None:
    tau, t = 1.5e-5, np.arange(100) * PERIOD * ratio
    block = AmplifierBandwidthHeld(tau=tau).block(Discretisation(PERIOD * ratio, PERIOD))
    y = block.run(t, block.rest(0.0, 0.0))[0]
    np.testing.assert_allclose(y[50:], t[50:] - PERIOD / np.expm1(PERIOD / tau), rtol=1e-9)
