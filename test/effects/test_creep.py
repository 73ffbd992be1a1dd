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

"""Creep against its law of time, scipy, and itself at other sample periods."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import signal
from scipy.special import gamma

from piezo_hysteresis.effects import Creep, CreepExponential, CreepFractional, Discretisation, Effect
from piezo_hysteresis.errors import ParameterError


def run(effect: Effect, x: np.ndarray, period: float) -> np.ndarray:
    block = effect.block(Discretisation(period, period))
    return block.run(x, block.rest(0.0, 0.0))[0]


@pytest.mark.parametrize("period", [1e-3, 1e-2])
def test_a_step_follows_the_logarithmic_law(period: float) -> None:
    gamma, n = 0.015, 20000
    y = run(Creep(gamma=gamma, tau_min=2e-5, tau_max=1e5), np.ones(n), period)
    t = (np.arange(n) + 0.5) * period  # the drive rises during the sample before, half a period ago on average
    late = t > 20 * period
    np.testing.assert_allclose(y[late], 1.0 + gamma * np.log10(t[late] / 0.1), rtol=1e-3 * gamma)


def test_the_response_after_0_1_s_does_not_change_with_gamma() -> None:
    block = Creep(gamma=0.1).block(Discretisation(1e-3, 1e-3))
    y, _ = block.run(np.ones(400), block.rest(0.0, 0.0))
    assert y[100] == pytest.approx(1.0 + 0.1 * np.log10(0.1005 / 0.1), abs=1e-6)


def test_on_sines_the_gain_falls_with_log_frequency_at_constant_phase() -> None:
    gamma = 0.02
    response = []
    for frequency in (0.1, 1.0, 10.0):
        t = np.arange(40000) / (frequency * 1000.0)
        wave = np.exp(-2j * np.pi * frequency * t)
        y = run(Creep(gamma=gamma, tau_min=1e-5, tau_max=1e6), np.sin(2 * np.pi * frequency * t), t[1])
        response.append(2j * np.mean((y - y[-20000:].mean())[-20000:] * wave[-20000:]))
    gain, phase = np.abs(response), np.angle(response)
    np.testing.assert_allclose(np.diff(gain), -gamma, rtol=0.02)
    np.testing.assert_allclose(phase, -gamma * np.pi / (2 * np.log(10.0)) / gain, rtol=0.03)


@pytest.mark.parametrize("exponent", [-0.3, 0.3])
def test_the_fractional_law_is_a_power_of_time(exponent: float) -> None:
    y = run(CreepFractional(gamma=0.02, exponent=exponent, tau_min=1e-6, tau_max=1e7), np.ones(100001), 1e-3)
    rises = [y[10 * k] - y[k] for k in (100, 1000, 10000)]
    np.testing.assert_allclose(np.log10(np.array(rises[1:]) / rises[:-1]), exponent, atol=0.01)
    scale = 0.02 * gamma(1.0 - exponent) / (exponent * np.log(10.0))
    expected = [scale * ((1e-2 * k) ** exponent - (1e-3 * k) ** exponent) / 0.1**exponent for k in (100, 1000, 10000)]
    np.testing.assert_allclose(rises, expected, rtol=0.03)


@pytest.mark.parametrize("exponent", [-0.3, 0.1, 0.4])
def test_the_law_holds_where_relaxations_are_slower_than_all_of_the_bank(exponent: float) -> None:
    effect = CreepFractional(gamma=0.02, exponent=exponent, tau_min=1e-6, tau_max=1000.0)  # for runs of 10 s
    y = run(effect, np.ones(10001), 1e-3)
    expected = 0.02 * gamma(1.0 - exponent) / (exponent * np.log(10.0)) * (100.0**exponent - 10.0**exponent)
    assert y[10000] - y[1000] == pytest.approx(expected, rel=1e-3)


def test_exponential_creep_is_the_transfer_function_of_scipy() -> None:
    c, tau, period = [0.02, 0.01], [0.03, 0.4], 1e-3
    x = np.random.default_rng(3).normal(size=2000).cumsum() * 0.1
    x[0] = 0.0
    parts = [signal.lsim(([k], [t, 1.0]), x, np.arange(x.size) * period)[1] for k, t in zip(c, tau, strict=True)]
    np.testing.assert_allclose(run(CreepExponential(c=c, tau=tau), x, period), x + sum(parts), atol=1e-10)


@pytest.mark.parametrize(
    "effect", [Creep(gamma=0.05, tau_min=1e-4), CreepExponential(c=[0.05], tau=[0.02])], ids=lambda e: e.name
)
def test_the_state_can_be_used_at_another_sample_period(effect: Effect) -> None:
    fine, coarse = effect.block(Discretisation(1e-3, 1e-3)), effect.block(Discretisation(5e-3, 1e-3))
    turns = np.interp(np.arange(2001), [0, 500, 900, 2000], [0.0, 1.0, 0.2, 0.7])
    whole, _ = fine.run(turns, fine.rest(0.3, 0.0))
    first, state = fine.run(turns[:501].copy(), fine.rest(0.3, 0.0))
    rest, _ = coarse.run(turns[505::5].copy(), state)
    np.testing.assert_allclose(first, whole[:501], rtol=1e-14)
    np.testing.assert_allclose(rest, whole[505::5], rtol=1e-11)


@pytest.mark.parametrize(
    ("kind", "values"),
    [(Creep, {"tau_min": 1.0, "tau_max": 2.0}), (CreepExponential, {"c": [0.1], "tau": [1.0, 2.0]})],
)
def test_invalid_time_constants_are_refused(kind: type[Effect], values: dict) -> None:
    with pytest.raises(ParameterError, match="tau"):
        kind(**values)
