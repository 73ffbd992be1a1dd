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

"""Rounds of learning: they converge where that is sure, stop at the noise, and never play what is predicted worse."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from piezo_hysteresis.compensation import Band, IterativeLearning, LearningFilter, Limits, ResponseCheck, learn, plan
from piezo_hysteresis.compensation.learning import default_filter
from piezo_hysteresis.effects import Arx, Creep, HysteresisMemory
from piezo_hysteresis.errors import ModelError
from piezo_hysteresis.model.parameter_covariance import ParameterCovariance

from .published import PERIOD, stage, swing

LIMITS = Limits(0.0, 10.0)
WANTED = swing(50.0, 2e-6, 8e-6, 3)
TRUTH = stage(Creep(gamma=0.01), HysteresisMemory(c=(0.03,) * 8))


def stage_with_noise(noise: float, seed: int = 0):
    rng = np.random.default_rng(seed)

    def play(u: np.ndarray) -> np.ndarray:
        assert u.min() >= 0.0 and u.max() <= 10.0
        y, _ = TRUTH.run(u, TRUTH.rest(0.0))
        return y + noise * rng.normal(size=u.size)

    return play


def learning(noise: float = 0.0, filter: LearningFilter | None = None) -> IterativeLearning:
    model = stage()
    return IterativeLearning(model, plan(model, WANTED, LIMITS), LIMITS, filter, noise=noise)


def test_two_rounds_remove_the_error_of_the_model() -> None:
    got = learn(learning(), stage_with_noise(0.0), rounds=2)
    rms = [r.rms / np.ptp(WANTED) for r in got.rounds]
    assert len(rms) == 3 and rms[0] > 0.02
    assert rms[1] < 0.1 * rms[0] and rms[2] < 3e-4
    assert got.best is got.rounds[-1]


def test_rounds_stop_at_the_noise_and_copy_little_of_it() -> None:
    noise = 5e-4 * np.ptp(WANTED)
    got = learn(learning(noise), stage_with_noise(noise), rounds=20)
    assert got.next is None and got.reason and len(got.rounds) < 8
    y, _ = TRUTH.run(got.best.plan.voltage, TRUTH.rest(0.0))
    begin = got.best.plan.begin
    left = np.sqrt(np.mean((y[begin : begin + WANTED.size] - WANTED) ** 2))
    assert left < 0.7 * noise


def test_an_error_that_is_noise_alone_is_not_corrected() -> None:
    model, noise = stage(), 5e-4 * np.ptp(WANTED)
    for seed in range(10):
        got = IterativeLearning(model, plan(model, WANTED, LIMITS), LIMITS, noise=noise)
        first = got.next
        assert first is not None
        measured = first.predicted + noise * np.random.default_rng(seed).normal(size=first.voltage.size)
        assert got.update(measured) is None
        assert "noise" in got.reason


def test_every_round_is_predicted_to_be_better_before_it_is_played() -> None:
    got = learn(learning(), stage_with_noise(0.0), rounds=6)
    for before, after in zip(got.rounds[:-1], got.rounds[1:], strict=True):
        assert after.expected < before.rms


def test_a_constant_error_is_predicted_by_its_own_size() -> None:
    """Its spectral line at 0 Hz has no partner of negative frequency; it counted twice."""
    _, left, now = LearningFilter(PERIOD, gain=0.9).correct(np.full(1000, 1e-7), 0.0)
    assert now == pytest.approx(1e-7, rel=1e-9)
    assert left == pytest.approx(1e-8, rel=1e-9)


@pytest.mark.parametrize("size", [1, 2, 3, 6])
def test_the_error_of_a_path_of_few_samples_is_corrected_where_it_is_above_the_noise(size: int) -> None:
    correction, left, now = LearningFilter(PERIOD, gain=0.9).correct(np.full(size, 1e-7), 1e-9)
    assert correction == pytest.approx(np.full(size, 0.9e-7), rel=0.01)
    assert left < 0.2 * now < 0.21e-7
    correction, _, _ = LearningFilter(PERIOD).correct(np.full(size, 1e-10), 1e-9)
    assert not correction.any()


def test_what_a_round_is_predicted_to_leave_contains_the_noise() -> None:
    """A path that lies 0.1 % of its range beside the wanted one, and noise of 0.05 %: 0.014 % were predicted."""
    model, noise = stage(), 5e-4 * np.ptp(WANTED)
    got = IterativeLearning(model, plan(model, WANTED, LIMITS), LIMITS, noise=noise)
    first = got.next
    assert first is not None
    beside = first.predicted + 1e-3 * np.ptp(WANTED)
    assert got.update(beside + noise * np.random.default_rng(1).normal(size=beside.size)) is not None
    assert got.expected == pytest.approx(np.hypot(noise, 1e-4 * np.ptp(WANTED)), rel=0.1)


def test_a_round_that_got_worse_is_the_last() -> None:
    got = learning()
    worse = np.random.default_rng(1)
    first = got.next
    assert first is not None
    got.update(stage_with_noise(0.0)(first.voltage))
    second = got.next
    assert second is not None
    assert got.update(second.predicted + 1e-6 * worse.normal(size=second.voltage.size)) is None
    assert "no better" in got.reason and got.best is got.rounds[0]
    with pytest.raises(ModelError, match="ended"):
        got.update(second.predicted)


def test_every_round_has_the_band_of_the_first_plan() -> None:
    model, band = stage(), Band(200.0, 500.0, 0.02)
    got = IterativeLearning(model, plan(model, WANTED, LIMITS, band=band), LIMITS)
    got = learn(got, stage_with_noise(0.0), rounds=2)
    assert len(got.rounds) == 3 and {r.plan.preview for r in got.rounds} == {got.rounds[0].plan.preview}
    assert got.rounds[0].plan.preview > plan(model, WANTED, LIMITS).preview


def test_every_round_begins_and_ends_where_the_first_one_does() -> None:
    """A stage that rests at 3 V would step to 0 V at the first sample of a round that was planned from 0 V."""
    model, rest = stage(), 3.0
    first = plan(model, WANTED, LIMITS, start=model.rest(rest), way_back=0.02)
    got = learn(IterativeLearning(model, first, LIMITS), lambda u: TRUTH.run(u, TRUTH.rest(rest))[0])
    assert len(got.rounds) == 3 and got.best is got.rounds[-1]
    for played in got.rounds:
        assert played.plan.voltage[[0, -1]] == pytest.approx([rest, rest], abs=1e-9)


def test_the_gain_is_zero_where_the_response_makes_convergence_unsure() -> None:
    frequency = np.array([0.0, 500.0, 600.0, 700.0, 800.0, 5000.0])
    turned = np.array([1.0, 1.0, -1.0, -1.0, 1.0, 1.0]).astype(complex)
    found = LearningFilter(PERIOD, check=ResponseCheck(frequency, turned, np.full(6, 0.01)))
    assert (found.at(np.array([100.0, 400.0, 1000.0])) > 0.8).all()
    assert not found.at(np.array([620.0, 650.0, 690.0])).any()
    inside = np.linspace(0.0, 4000.0, 500)
    assert (found.factor(inside) <= 1.0).all()
    unsure = ResponseCheck(frequency, np.ones(6, dtype=complex), np.full(6, 0.8))
    with pytest.raises(ModelError, match="not certain at any frequency"):
        LearningFilter(PERIOD, check=unsure)


def test_the_gain_is_zero_where_the_identified_response_is_not_sure() -> None:
    """A first-order pole a: |∂ ln G/∂a| = 1/|1 + a z⁻¹|, largest where its own response is."""
    a, spread = -0.98, 5e-3
    pole = stage().with_effect(Arx(a=[a], b=[1.0 + a]))
    known = replace(pole, covariance=ParameterCovariance.of(["arx.a[0]", "offset.y0"], np.diag([spread**2, 1e-18])))
    frequency = np.array([1.0, 30.0, 100.0, 1000.0])
    check = ResponseCheck.of(known, frequency)
    assert check is not None and ResponseCheck.of(pole, frequency) is None
    z = np.exp(-2j * np.pi * frequency * PERIOD)
    np.testing.assert_allclose(check.deviation, spread / np.abs(1.0 + a * z), rtol=1e-6)
    unsure = replace(known, covariance=ParameterCovariance.of(["arx.a[0]"], np.array([[0.02**2]])))
    np.testing.assert_allclose(default_filter(known).at(frequency), 0.9)
    np.testing.assert_allclose(default_filter(unsure).at(frequency), [0.0, 0.0, 0.0, 0.9])


def test_the_gain_tapers_to_zero() -> None:
    gain = LearningFilter(PERIOD).at(np.linspace(0.0, 5000.0, 2000))
    assert gain[0] == 0.9 and gain[-1] == 0.0 and (np.diff(gain) <= 1e-12).all() and np.abs(np.diff(gain)).max() < 0.01


def test_invalid_values_are_refused() -> None:
    with pytest.raises(ModelError, match="gain"):
        LearningFilter(PERIOD, gain=1.5)
    with pytest.raises(ModelError, match="noise"):
        learning(noise=-1.0)
    with pytest.raises(ModelError, match="samples"):
        learning().update(np.zeros(10))
