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

"""The loop against Eq. (2) integrated by scipy, and the promises of its two kernels."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from piezo_hysteresis.blocks.bouc_wen.bouc_wen_kernel import run_general, run_plain
from piezo_hysteresis.effects import (
    AsymmetricHysteresis,
    BoucWen,
    Discretisation,
    HysteresisExponent,
    InitialState,
    PublishedBoucWen,
    RateDependentHysteresis,
    RateDependentHysteresisLagged,
    Term,
)
from piezo_hysteresis.errors import ModelError, ParameterError

PERIOD = 1e-3
SETTING = Discretisation(PERIOD, PERIOD)
TURNS = np.array([0.0, 0.6, 0.2, 0.5, -0.4, 0.3])


def polyline(turns: np.ndarray, steps: int) -> np.ndarray:
    """Straight lines between turning points, `steps` samples each."""
    return np.interp(np.arange(steps * (turns.size - 1) + 1) / steps, np.arange(turns.size), turns)


def state_of(v: np.ndarray, *terms: Term, **values: float) -> np.ndarray:
    """h of the loop alone: p1 = p2 = 0."""
    block = BoucWen(p1=0.0, p2=0.0, **values).block(SETTING, terms)
    return block.run(v, block.rest(v[0], 0.0))[0]


def integrated(turns: np.ndarray, rate, h: float = 0.0) -> np.ndarray:
    """h at the turning points from dh/dv = rate(h, s) in direction s, by scipy."""
    ends = [h]
    for a, b in zip(turns[:-1], turns[1:], strict=True):
        s = np.sign(b - a)
        crossing = lambda v, h: h[0]  # noqa: E731
        v = a
        while (b - v) * s > 1e-12:
            part = solve_ivp(
                lambda v, h, s=s: rate(h, s), (v, b), [h], rtol=1e-11, atol=1e-13, events=crossing, max_step=0.01
            )
            v, h = part.t[-1], part.y[0, -1]
        ends.append(h)
    return np.array(ends)


def law(values: dict[str, float], phi1=0.0, phi2=0.0, n=1.0, amplitude=1.0):
    """Eq. (2) with terms, as dh/dv in direction s."""
    a, beta, gamma = values["A"] * amplitude, values["beta"], values["gamma"]

    def rate(h, s):
        power = np.abs(h / 0.2) ** (n - 1.0)
        loss = power * (beta * s * h + gamma * np.abs(h))
        return a - loss + phi1 * h + phi2 * s * np.abs(h)

    return rate


VALUES = {"A": -0.7691, "beta": 4.6075, "gamma": -0.8725}


def test_the_loop_solves_equation_2_exactly_at_any_number_of_samples() -> None:
    expected = integrated(TURNS, law(VALUES))
    for steps in (1, 7, 500):
        got = state_of(polyline(TURNS, steps), **VALUES)[::steps]
        np.testing.assert_allclose(got, expected, atol=2e-10)


def test_asymmetry_solves_its_equation() -> None:
    expected = integrated(TURNS, law(VALUES, phi1=0.9, phi2=-0.5))
    got = state_of(polyline(TURNS, 11), AsymmetricHysteresis(phi1=0.9, phi2=-0.5), **VALUES)[::11]
    np.testing.assert_allclose(got, expected, atol=2e-10)


@pytest.mark.parametrize("n", [1.2, 1.7, 2.0])
def test_exponent_solves_its_equation(n: float) -> None:
    expected = integrated(TURNS, law(VALUES, n=n))
    got = state_of(polyline(TURNS, 200), HysteresisExponent(n=n), **VALUES)[::200]
    np.testing.assert_allclose(got, expected, atol=3e-5)


@pytest.mark.parametrize(("k", "a"), [(0.05, 0.5), (-0.03, 0.0), (0.02, 1.0)])
def test_rate_changes_the_slope_of_the_state_with_speed(k: float, a: float) -> None:
    v = np.arange(200) * 0.003
    speed = 0.003 / PERIOD
    factor = 1.0 + k * (np.log(speed) if a == 0.0 else (speed**a - 1.0) / a)
    expected = state_of(v, **{**VALUES, "A": VALUES["A"] * factor})
    np.testing.assert_allclose(state_of(v, RateDependentHysteresis(k=k, a=a), **VALUES), expected, rtol=1e-12)


def test_rate_law_is_continuous_at_the_logarithm() -> None:
    v = np.sin(np.arange(200) / 10.0)
    near = state_of(v, RateDependentHysteresis(k=0.05, a=1e-7), **VALUES)
    np.testing.assert_allclose(state_of(v, RateDependentHysteresis(k=0.05, a=0.0), **VALUES), near, atol=1e-7)


@pytest.mark.parametrize("tau", [2e-4, 3e-3])
@pytest.mark.parametrize("steps", [40, 400])
def test_a_lag_of_the_speed_solves_its_equation(tau: float, steps: int) -> None:
    k, a, piece = 0.05, 0.2, 4e-3

    def slopes(t, y, speed):
        h, q = y
        factor = 1.0 + k * (np.maximum(q, 1e-4) ** a - 1.0) / a
        loss = VALUES["beta"] * abs(speed) * h + VALUES["gamma"] * speed * abs(h)
        return VALUES["A"] * factor * speed - loss, (abs(speed) - q) / tau

    state, expected = (0.0, 0.0), [0.0]
    for start, end in zip(TURNS[:-1], TURNS[1:], strict=True):
        speed = (end - start) / piece
        fine = {"rtol": 1e-9, "atol": 1e-12, "max_step": piece / 300}
        state = solve_ivp(slopes, (0.0, piece), state, args=(speed,), **fine).y[:, -1]
        expected.append(state[0])
    setting = Discretisation(piece / steps, piece / steps)
    terms = (RateDependentHysteresisLagged(k=k, a=a, tau=tau),)
    block = BoucWen(p1=0.0, p2=0.0, **VALUES).block(setting, terms)
    got = block.run(polyline(TURNS, steps), block.rest(0.0, 0.0))[0][::steps]
    np.testing.assert_allclose(got, expected, atol=0.1 * k / steps)


def test_without_a_lag_the_speed_acts_at_once() -> None:
    v, law = polyline(TURNS, 30), {"k": 0.05, "a": 0.2}
    at_once = state_of(v, RateDependentHysteresis(**law), **VALUES)
    np.testing.assert_array_equal(state_of(v, RateDependentHysteresisLagged(**law), **VALUES), at_once)
    soon = state_of(v, RateDependentHysteresisLagged(**law, tau=1e-9), **VALUES)
    np.testing.assert_allclose(soon, at_once, atol=1e-7)


def test_a_jump_of_a_slow_record_decays_for_the_rest_of_its_sample() -> None:
    slow, law = Discretisation(4e-3, 1e-4), {"k": 0.05, "a": 0.2, "tau": 1e-3}
    terms = (RateDependentHysteresisLagged(**law),)
    ways = []
    for setting, drive in ((slow, np.array([0.0, 0.4, 0.42])), (Discretisation(1e-4, 1e-4), np.zeros(81))):
        if setting is not slow:
            drive[1:] = np.concatenate((np.full(40, 0.4), 0.4 + 0.02 * np.arange(1, 41) / 40))
        block = BoucWen(p1=0.0, p2=0.0, **VALUES).block(setting, terms)
        ways.append(block.run(drive, block.rest(0.0, 0.0))[0][-1])
    assert ways[0] == pytest.approx(ways[1], abs=1e-5)


def test_a_remanent_state_is_present_at_rest_and_lost_after_a_swing() -> None:
    v = np.concatenate((np.zeros(50), polyline(np.array([0.0, 3.0, 0.0]), 100)))
    clean, remanent = state_of(v, **VALUES), state_of(v, InitialState(h0=0.05), **VALUES)
    np.testing.assert_array_equal(remanent[:50], 0.05)
    assert abs(remanent[-1] - clean[-1]) < 1e-6


numbers = st.floats(-1.0, 1.0)


@settings(max_examples=40)
@given(
    st.lists(numbers, min_size=2, max_size=40),
    st.floats(-3.0, 3.0),
    st.floats(0.0, 20.0),
    st.floats(-1.0, 1.0),
)
def test_the_general_kernel_with_everything_off_is_the_plain_one_bit_for_bit(
    v: list[float], a: float, beta: float, share: float
) -> None:
    loop = np.array([a, beta, share * beta, 0.0, 0.0, 1.0, 0.0, 0.5])
    samples, plain, general = np.array(v), np.empty(len(v)), np.empty(len(v))
    start = np.array([0.01, v[0]])
    run_plain(samples, loop, -0.1, 2.0, start.copy(), plain)
    run_general(samples, loop, -0.1, 2.0, PERIOD, PERIOD, start.copy(), general)
    np.testing.assert_array_equal(general, plain)


@settings(max_examples=40)
@given(
    st.lists(numbers, min_size=2, max_size=60),
    st.sampled_from([-0.8, 0.8]),
    st.floats(0.5, 20.0),
    st.floats(-0.95, 0.95),
)
def test_the_state_stays_below_its_bound(v: list[float], a: float, beta: float, share: float) -> None:
    gamma = share * beta
    h = state_of(np.array(v), A=a, beta=beta, gamma=gamma)
    assert np.abs(h).max() <= abs(a) / (beta + np.sign(a) * gamma) * (1 + 1e-12)


@settings(max_examples=30)
@given(st.lists(numbers, min_size=3, max_size=20), st.integers(2, 5))
def test_the_result_does_not_depend_on_how_finely_a_line_is_sampled(turns: list[float], steps: int) -> None:
    v = np.array(turns)
    np.testing.assert_allclose(state_of(polyline(v, steps), **VALUES)[::steps], state_of(v, **VALUES), atol=1e-13)


def test_the_published_form_is_equation_7() -> None:
    v = polyline(TURNS, 40)
    effect = PublishedBoucWen()
    block = effect.block(SETTING)
    w, _ = block.run(v, block.rest(v[0], 0.0))
    h, expected = 0.0, []
    for before, now in zip(np.append(v[0], v[:-1]), v, strict=True):
        dv = now - before
        h += effect["A"] * dv - effect["beta"] * abs(dv) * h - effect["gamma"] * dv * abs(h)
        expected.append(effect["p1"] * now**3 + effect["p2"] * now + h)
    np.testing.assert_allclose(w, expected, rtol=1e-13)


def test_the_published_form_converges_to_the_exact_one() -> None:
    def error(steps: int) -> float:
        v = polyline(TURNS, steps)
        block = PublishedBoucWen(p1=0.0, p2=0.0).block(SETTING)
        return float(np.abs(block.run(v, block.rest(v[0], 0.0))[0] - state_of(v, **VALUES)).max())

    assert error(2000) < 0.6 * error(1000) < 0.36 * error(500)


def test_rounding_does_not_decide_the_number_of_sub_steps() -> None:
    """A slew limit makes steps of exactly four sub-steps, but for their rounding."""
    block = BoucWen().block(SETTING, (HysteresisExponent(n=1.3),))
    start, tangent = block.rest(0.2, 0.0), block.rest_tangent(0.2, np.empty(0))
    exact, larger, sensitive = np.empty(9), np.empty(9), np.empty(9)
    for k in range(9):
        step = np.array([0.21, 0.21 + 0.01 * (k + 1)])
        exact[k] = block.run(np.array([step[0], step[1] - 1e-14]), start)[0][1]
        larger[k] = block.run(np.array([step[0], step[1] + 1e-14]), start)[0][1]
        state = block.run(step[:1].copy(), start)[1]
        sensitive[k] = block.linearise(step[1:] + 1e-14, np.empty((0, 1)), state, tangent)[0][0]
    np.testing.assert_allclose(larger, exact, rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(sensitive, exact, rtol=0.0, atol=1e-12)


@pytest.mark.parametrize("kind", [BoucWen, PublishedBoucWen])
def test_own_sensitivities_do_not_depend_on_upstream_ones_bit_for_bit(kind) -> None:
    turns = np.random.default_rng(5).normal(scale=0.3, size=40)
    block, v = kind().block(SETTING), np.concatenate((polyline(turns, 8), turns, np.repeat(turns, 2)))
    nothing, held = np.empty((0, v.size)), np.zeros((1, v.size))
    w, alone, *_ = block.linearise(v, nothing, block.rest(0.0, 0.0), block.rest_tangent(0.0, np.empty(0)))
    beside_w, beside, *_ = block.linearise(v, held, block.rest(0.0, 0.0), block.rest_tangent(0.0, np.zeros(1)))
    np.testing.assert_array_equal(w, beside_w)
    np.testing.assert_array_equal(w, block.run(v, block.rest(0.0, 0.0))[0])
    np.testing.assert_array_equal(alone, beside[1:])


@pytest.mark.parametrize("kind", [BoucWen, PublishedBoucWen])
def test_an_unbounded_loop_is_refused(kind) -> None:
    with pytest.raises(ParameterError, match="expected beta >= "):
        kind(beta=1.0, gamma=-1.5)


def test_a_term_has_no_separate_block() -> None:
    with pytest.raises(ModelError, match="term of 'bouc_wen'"):
        InitialState(h0=0.1).block(SETTING)


def test_a_change_in_one_slow_sample_is_a_jump_or_a_ramp_as_the_rate_law_is_reported() -> None:
    slow, own = Discretisation(1e-2, 2e-5), Discretisation(1e-2, 1e-2)
    stairs = np.repeat([0.0, 0.2, 0.4, 0.1], 50)

    def loop(setting: Discretisation, jumps: float) -> np.ndarray:
        effect = BoucWen(A=0.4, beta=3.0, gamma=0.5, p1=0.0, p2=1.0)
        block = effect.block(setting, (RateDependentHysteresis(k=0.05, a=0.2, jumps=jumps),))
        return block.run(stairs, block.rest(0.0, 0.0))[0]

    np.testing.assert_array_equal(loop(slow, 0.0), loop(own, 1.0))
    assert np.abs(loop(slow, 1.0) - loop(slow, 0.0)).max() > 1e-3
