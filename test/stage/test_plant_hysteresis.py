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

"""The loops of the plant: closed forms, the paper's recursion in the limit, rate independence and memory."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from piezo_hysteresis.errors import ParameterError
from piezo_hysteresis.stage.plant.clock import Clock
from piezo_hysteresis.stage.plant.hysteresis import Hysteresis, Operator

SLOW = Clock.cut(1.0, 0.0, 1.0)
turning_points = st.lists(st.floats(-10.0, 10.0), min_size=2, max_size=12)


def output(hysteresis, voltage, start=0.0, clock=SLOW):
    """w for a drive given at every sub-step [V], from rest at `start`."""
    return Operator(hysteresis, clock, start).run(np.array(voltage, dtype=float))


def between(*levels, points=2000):
    """Straight lines between levels [V], without the first one."""
    return np.concatenate([np.linspace(a, b, points + 1)[1:] for a, b in zip(levels, levels[1:], strict=False)])


@settings(max_examples=50)
@given(turning_points)
def test_bouc_wen_is_exact_in_v_however_fine_the_drive(turns):
    coarse = output(Hysteresis(), turns)
    fine = output(Hysteresis(), between(0.0, *turns, points=50))[49::50]
    np.testing.assert_allclose(fine, coarse, atol=1e-13)


def test_bouc_wen_is_the_limit_of_the_published_recursion():
    """Paper, Eq. (6) and (7), with steps of 1e-5 in v."""
    drive = between(0.0, 6.0, 1.0, 5.0, 3.0, points=40000)
    p, v = Hysteresis(), drive / 10
    h, states = 0.0, []
    for dv in np.diff(v, prepend=0.0).tolist():
        h += p.A * dv - p.beta * abs(dv) * h - p.gamma * dv * abs(h)
        states.append(h)
    np.testing.assert_allclose(output(p, drive), p.p1 * v**3 + p.p2 * v + states, atol=2e-5)


def test_loading_curve_in_closed_form():
    """h(v) = A/q (1 − exp(−q v)) with q = β − γ, because A and so h are negative while v rises."""
    p, v = Hysteresis(), np.linspace(0.0, 1.0, 11)
    q = p.beta - p.gamma
    expected = p.p1 * v**3 + p.p2 * v + p.A / q * (1 - np.exp(-q * v))
    np.testing.assert_allclose(output(p, 10 * v), expected, rtol=1e-13)


@settings(max_examples=30)
@given(turning_points, st.booleans())
def test_without_its_rate_law_hysteresis_does_not_depend_on_time(turns, plays):
    hysteresis = Hysteresis.prandtl_ishlinskii() if plays else Hysteresis(phi1=0.5, phi2=-0.3, exponent=1.4)
    slow, fast = Clock.cut(100.0, 0.0, 100.0), Clock.cut(1e-6, 0.0, 1e-6)
    np.testing.assert_array_equal(output(hysteresis, turns, clock=slow), output(hysteresis, turns, clock=fast))


@settings(max_examples=50)
@given(st.floats(0.0, 4.0), st.floats(6.0, 10.0), st.lists(st.floats(4.0, 6.0), min_size=1, max_size=8))
def test_plays_have_return_point_memory(low, high, inner):
    """Whatever happened in between, back at the last outer turning points the output is what it was."""
    pi = Hysteresis.prandtl_ishlinskii()
    before = output(pi, [high, low, high, low])
    after = output(pi, [high, low, high, low, *inner, high, low])
    np.testing.assert_allclose(after[-2:], before[-2:], atol=1e-13)


def test_bouc_wen_has_no_return_point_memory():
    """A minor loop at its top leaves another output behind: the difference a gap finder can see."""
    wiped = output(Hysteresis(), [6.0, 2.0, 6.0]), output(Hysteresis(), [6.0, 2.0, 4.0, 3.0, 4.0, 3.0, 6.0])
    assert abs(wiped[0][-1] - wiped[1][-1]) > 1e-4
    plays = Hysteresis(play_radii=(0.02, 0.05), play_weights=(0.1, 0.1))
    more = output(plays, [6.0]) - output(Hysteresis(), [6.0])
    assert more.item() == pytest.approx(0.1 * (0.6 - 0.02) + 0.1 * (0.6 - 0.05))


def test_minor_loops_of_plays_between_the_same_levels_are_congruent():
    pi = replace(Hysteresis.prandtl_ishlinskii(), p1=0.0)
    minor = between(5.0, 6.0, 5.0, points=100)
    rising = output(pi, np.r_[0.0, 5.0, 6.0, 5.0, minor])[4:]
    falling = output(pi, np.r_[10.0, 5.0, 6.0, 5.0, minor])[4:]
    np.testing.assert_allclose(rising - rising[-1], falling - falling[-1], atol=1e-13)
    assert abs(rising[-1] - falling[-1]) > 0.01


def test_both_operators_open_a_loop_of_realistic_width():
    """Between 1 and 6 V the branches are 5 to 20 % of the stroke apart."""
    for hysteresis in (Hysteresis(), Hysteresis.prandtl_ishlinskii()):
        w = output(hysteresis, between(0.0, 6.0, 1.0, 6.0))
        down, up = w[2000:4000], w[4000:]
        width = np.abs(up - down[::-1]).max() / np.ptp(w[2000:])
        assert 0.05 < width < 0.2


def test_exponent_and_asymmetry_equal_a_general_ode_solver():
    p = Hysteresis(exponent=1.6, phi1=0.7, phi2=-0.4)

    def slope(_, h, s):
        scaled = abs(h / p.reference_state) ** (p.exponent - 1)
        rise = p.A * s - (p.beta * h + p.gamma * s * abs(h)) * scaled + p.phi1 * s * h + p.phi2 * abs(h)
        return rise

    h, v = np.zeros(1), 0.0
    for target in (0.7, 0.2, 0.6, 0.3):
        s, length = math.copysign(1.0, target - v), abs(target - v)
        h = solve_ivp(slope, (0.0, length), h, args=(s,), rtol=1e-11, atol=1e-13).y[:, -1]
        v = target
    w = output(p, between(0.0, 7.0, 2.0, 6.0, 3.0))[-1]
    assert w == pytest.approx(p.p1 * v**3 + p.p2 * v + h.item(), abs=1e-9)
    # the closed step for n = 1 with the same asymmetry
    closed = output(replace(p, exponent=1.0), [7.0, 2.0, 6.0, 3.0])[-1]
    nearly = output(replace(p, exponent=1.0 + 1e-12), between(0.0, 7.0, 2.0, 6.0, 3.0))[-1]
    assert closed == pytest.approx(nearly, abs=1e-9)


@pytest.mark.parametrize("rate", [0.01, 1.0, 300.0])
def test_rate_law_scales_the_slope_of_h(rate):
    """At constant |v̇| the loop is that of A [1 + k (|v̇|^a − 1)/a], whatever amplitude and frequency make the rate."""
    p = Hysteresis(rate_gain=0.03, rate_time=1e-6)
    step = 1e-3 / rate
    drive = 10 * np.arange(1, 601) * 1e-3
    scaled = replace(p, rate_gain=0.0, A=p.A * (1 + p.rate_gain * (rate**p.rate_exponent - 1) / p.rate_exponent))
    fast = output(p, drive, clock=Clock.cut(step, 0.0, step))
    np.testing.assert_allclose(fast, output(scaled, drive), atol=2e-5)


def test_backlash_hides_motion_smaller_than_its_width():
    p = Hysteresis(backlash=0.05)
    small = output(p, 5.0 + 0.05 * np.sin(np.arange(100)), start=5.0)
    np.testing.assert_array_equal(small, small[0])
    # a slow rise comes through late by the half width
    np.testing.assert_allclose(output(p, [6.05], start=5.0), output(replace(p, backlash=0.0), [6.0], start=5.0))


def test_even_polynomial_shows_on_bipolar_drive():
    plain, even = Hysteresis(), Hysteresis(even2=0.05, even4=0.02)
    drive = between(0.0, 8.0, -8.0, 8.0, -8.0)
    v = drive / 10
    np.testing.assert_allclose(output(even, drive) - output(plain, drive), 0.05 * v**2 + 0.02 * v**4, atol=1e-13)
    loop = output(plain, drive)
    np.testing.assert_allclose(loop[-4000:-2000], -loop[-2000:], atol=1e-4)


def test_initial_state_is_there_at_rest_and_forgotten_after_a_cycle():
    plain, pushed = Hysteresis(), Hysteresis(initial_state=0.1)
    drive = between(3.0, 3.0, 9.0, 0.0)
    difference = output(pushed, drive, start=3.0) - output(plain, drive, start=3.0)
    assert difference[0] == pytest.approx(0.1)
    assert abs(difference[-1]) < 1e-3


@pytest.mark.parametrize(
    ("wrong", "names"),
    [
        ({"beta": 1.0, "gamma": 2.0}, "beta"),
        ({"play_radii": (0.1,)}, "play_weights"),
        ({"rate_gain": 0.2}, "rate_exponent"),
        ({"exponent": 0.5}, "exponent"),
    ],
)
def test_loops_that_make_no_sense_are_refused(wrong, names):
    with pytest.raises(ParameterError, match=names):
        Hysteresis(**wrong)
