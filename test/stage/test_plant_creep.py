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

"""Creep of the plant: closed step responses, and exactly nothing where it is off."""

import numpy as np
import pytest

from piezo_hysteresis.errors import ParameterError
from piezo_hysteresis.stage.plant.clock import Clock
from piezo_hysteresis.stage.plant.creep import Bank, PlantCreep


def step_response(creep, period, size):
    """Response to a unit step; entry i belongs to time (i + 1) · period."""
    bank = Bank(creep, Clock.cut(period, 0.0, period), 0.0)
    bank.run(np.ones(1))  # the step itself, a straight line over one sub-step
    return bank.run(np.ones(size))


def test_logarithmic_creep_grows_by_gamma_per_decade_from_the_response_at_100_ms():
    """0.1 ms to 1000 s; the ends of the bank are a decade away at least."""
    for period in (1e-5, 0.01, 1.0):
        time = (np.arange(2000) + 1.5) * period
        y = step_response(PlantCreep(gamma=0.015), period, 2000)
        inside = (time > 2e-4) & (time < 1000.0)
        ideal = 1 + 0.015 * np.log10(time / 0.1)
        np.testing.assert_allclose(y[inside], ideal[inside], atol=3e-4)


def test_fractional_creep_bends_upwards_and_contains_the_logarithm():
    period, y = 0.01, {}
    for slope in (-0.2, 0.0, 0.2):
        y[slope] = step_response(PlantCreep(gamma=0.01, slope=slope), period, 20000)
    late, early = 19999, 199
    growth = {s: (r[late] - r[late // 10]) / (r[early] - r[early // 10]) for s, r in y.items()}
    assert growth[-0.2] < growth[0.0] < growth[0.2]
    assert growth[0.0] == pytest.approx(1.0, rel=0.05)
    assert growth[0.2] == pytest.approx(100**0.2, rel=0.05)


def test_exponential_creep_in_closed_form():
    times, weights = np.array([0.05, 2.0]), np.array([0.02, 0.01])
    y = step_response(PlantCreep(times=tuple(times), weights=tuple(weights)), 1e-3, 5000)
    # a straight line over the first sub-step, then exponential
    t = 1e-3 * np.arange(1, 5001)
    start = times / 1e-3 * -np.expm1(-1e-3 / times)
    expected = 1 + weights @ (1 - start[:, None] * np.exp(-t / times[:, None]))
    np.testing.assert_allclose(y, expected, rtol=1e-12)


def test_off_creep_returns_the_very_samples():
    w = np.random.default_rng(0).standard_normal(100)
    off = Bank(PlantCreep(slope=0.3), Clock.cut(20e-6, 0.0, 5e-6), 0.7)
    assert off.run(w) is w
    assert off.rest == 0.7


def test_creep_in_the_stage_is_seen_in_a_long_hold(ideal):
    from piezo_hysteresis.stage.plant import Plant

    plant = Plant(ideal(creep__gamma=0.02), 1e-3)
    y = plant.run(np.full(20001, 5.0)).displacement
    assert y[10000] / y[1000] == pytest.approx((1 + 0.02 * 2) / (1 + 0.02), abs=5e-4)


@pytest.mark.parametrize(
    "wrong", [{"gamma": 0.1, "slope": -0.4}, {"times": (1.0,)}, {"times": (0.0,), "weights": (1.0,)}]
)
def test_creep_that_makes_no_sense_is_refused(wrong):
    with pytest.raises(ParameterError, match="creep"):
        PlantCreep(**wrong).elements()
