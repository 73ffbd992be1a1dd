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

"""The ARX against scipy, its delay, its lag in slow records, and the softening of its mode."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.polynomial import polynomial
from scipy import signal
from scipy.integrate import solve_ivp

from piezo_hysteresis.blocks.softening.mode_path import share_of_mode, split
from piezo_hysteresis.effects import Arx, Discretisation, Softening, SofteningOfOneMode
from piezo_hysteresis.errors import ModelError, ParameterError

PAPER = {
    "a": [-0.05847, 0.2423, -0.05833, -0.4917, 0.4170, -0.1945, 0.07748, -0.01198],
    "b": [0.004481, 0.04629, 0.1320, 0.1154, -0.02198, -0.06236, -0.0007691, 0.01408],
    "delay": 3,
}
FAST = Discretisation(2e-5, 2e-5)


def run(effect: Arx, x: np.ndarray, setting: Discretisation = FAST, *terms: Softening) -> np.ndarray:
    block = effect.block(setting, terms)
    return block.run(x, block.rest(x[0], 0.0))[0]


@settings(max_examples=20)
@given(st.integers(1, 6), st.integers(0, 5), st.integers(0, 2**32 - 1))
def test_it_is_the_filter_of_scipy(delay: int, pairs: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    poles = rng.uniform(0.0, 0.95, pairs) * np.exp(1j * rng.uniform(0.0, np.pi, pairs))
    a = np.atleast_1d(np.poly(np.concatenate((poles, poles.conj()))).real)[1:]
    b = rng.normal(size=rng.integers(1, 9))
    x = rng.normal(size=300)
    x[:5] = 0.0
    expected = signal.lfilter(np.append(np.zeros(delay), b), np.append(1.0, a), x)
    np.testing.assert_allclose(run(Arx(a=a, b=b, delay=delay), x), expected, atol=1e-9 * np.abs(expected).max() + 1e-12)


def test_group_delay_and_response_are_those_of_scipy() -> None:
    arx = Arx(**PAPER)
    b, a = np.append(np.zeros(3), PAPER["b"]), np.append(1.0, PAPER["a"])
    frequency = np.array([1.0, 400.0, 1000.0, 20000.0])
    _, expected = signal.freqz(b, a, frequency, fs=5e4)
    np.testing.assert_allclose(arx.response(frequency, 2e-5), expected, rtol=1e-12)
    assert arx.group_delay == pytest.approx(signal.group_delay((b, a), [1e-3], fs=5e4)[1][0], rel=1e-6)
    assert arx.dc_gain == pytest.approx(0.24641, abs=1e-5)


@pytest.mark.parametrize("delay", [1.3, 2.5, 4.75])
def test_a_fractional_delay_moves_a_slow_sine_by_that_time(delay: float) -> None:
    t = np.arange(4000.0)
    x = np.sin(2 * np.pi * t / 200.0)
    y = run(Arx(a=[], b=[1.0], delay=delay), x)
    np.testing.assert_allclose(y[50:], np.sin(2 * np.pi * (t[50:] - delay) / 200.0), atol=1e-6)


@pytest.mark.parametrize("ratio", [2.0, 7.5, 100.0])
def test_a_slow_ramp_gets_dc_gain_and_group_delay(ratio: float) -> None:
    arx = Arx(**PAPER)
    x = np.arange(60.0)
    y = run(arx, x, Discretisation(2e-5 * ratio, 2e-5))
    np.testing.assert_allclose(y[10:], arx.dc_gain * (x[10:] - arx.group_delay / ratio), rtol=1e-9)


def test_a_slow_sine_is_the_decimated_fast_one() -> None:
    arx, factor = Arx(**PAPER), 20
    t = np.arange(40000) * 2e-5
    x = np.sin(2 * np.pi * 5.0 * t)
    fast = run(arx, x)[::factor]
    slow = run(arx, x[::factor].copy(), Discretisation(2e-5 * factor, 2e-5))
    np.testing.assert_allclose(slow[100:], fast[100:], atol=1e-4 * arx.dc_gain)


def slow_slopes(effect: Arx, drive: np.ndarray) -> np.ndarray:
    block = effect.block(Discretisation(1e-3, 1e-4))
    nothing = np.empty((0, drive.size))
    return block.linearise(drive, nothing, block.rest(0.0, 0.0), block.rest_tangent(0.0, np.empty(0)))[1]


@pytest.mark.parametrize("b", [(0.5, 0.2), (0.5, -0.4)])
def test_slopes_in_slow_records_are_those_of_the_output(b: tuple[float, float]) -> None:
    """The second numerator leads, which is cut off at no delay."""
    values, drive, h = {"a": (-0.3,), "b": b, "delay": 0.0 if b[1] < 0.0 else 3.0}, np.sin(np.arange(50.0) / 5.0), 1e-6
    slopes = slow_slopes(Arx(**values), drive)
    for k, (name, index) in enumerate((("a", 0), ("b", 0), ("b", 1))):
        ends = []
        for step in (h, -h):
            row = np.array(values[name])
            row[index] += step
            block = Arx(**{**values, name: row}).block(Discretisation(1e-3, 1e-4))
            ends.append(block.run(drive, block.rest(0.0, 0.0))[0])
        np.testing.assert_allclose(slopes[k], (ends[0] - ends[1]) / (2 * h), atol=1e-7)


def test_no_response_at_dc_is_refused_in_slow_records() -> None:
    with pytest.raises(ParameterError, match=r"got a group delay of inf samples near dc.*B\(1\)"):
        Arx(a=(-0.3,), b=(0.5, -0.5)).block(Discretisation(1e-3, 1e-4))


@pytest.mark.parametrize("values", [{"a": [-1.0]}, {"a": [0.0, 1.01]}, {"b": []}, {"delay": -0.5}])
def test_an_unstable_or_empty_arx_is_refused(values: dict) -> None:
    with pytest.raises(ParameterError, match="arx"):
        Arx(**values)


def test_split_multiplies_back() -> None:
    a = np.array(PAPER["a"])
    mode, rest, by_a = split(a, np.array(PAPER["b"]))
    np.testing.assert_allclose(polynomial.polymul(np.append(1.0, mode), np.append(1.0, rest))[1:], a, atol=1e-12)
    moved = a + 1e-6 * np.arange(8.0)
    mode_after, rest_after, _ = split(moved, np.array(PAPER["b"]))
    change = np.concatenate((mode_after - mode, rest_after - rest))
    np.testing.assert_allclose(change, by_a @ (moved - a), rtol=1e-3, atol=1e-9)


def test_a_softened_stage_settles_on_its_static_curve() -> None:
    k2, k3 = -0.05, 0.03
    x = np.concatenate((np.zeros(5), np.full(20000, 0.8)))
    (deflection,) = [r.real for r in np.roots([k3, k2, 1.0, -0.8]) if abs(r.imag) < 1e-12 and 0 < r.real < 1]
    arx = Arx(**PAPER)
    for setting in (FAST, Discretisation(1e-3, 2e-5)):
        y = run(arx, x, setting, Softening(k2=k2, k3=k3))
        assert y[-1] == pytest.approx(arx.dc_gain * deflection, rel=1e-9)


def test_the_softened_mode_is_a_duffing_oscillator() -> None:
    rate, zeta, period, k3 = 2 * np.pi * 200.0, 0.02, 5e-7, 0.2
    poles = np.exp(rate * period * (-zeta + 1j * np.sqrt(1 - zeta**2)))
    a = np.poly([poles, poles.conjugate()])[1:]
    arx = Arx(a=a, b=[1.0 + a.sum()], delay=1)
    n = 40000
    y = run(arx, np.append(0.0, np.full(n, 0.6)), Discretisation(period, period), Softening(k3=k3))

    def motion(t: float, z: np.ndarray) -> list[float]:
        return [z[1], rate**2 * (0.6 - z[0] - k3 * z[0] ** 3) - 2 * zeta * rate * z[1]]

    times = np.arange(n + 1) * period
    expected = solve_ivp(motion, (0.0, times[-1]), [0.0, 0.0], t_eval=times, rtol=1e-9, atol=1e-12).y[0]
    linear = run(arx, np.append(0.0, np.full(n, 0.6)), Discretisation(period, period))
    assert np.abs(y - expected).max() < 0.02 * np.abs(linear - expected).max()


def test_softening_needs_a_resonance() -> None:
    with pytest.raises(ModelError, match="no complex pole pair"):
        run(Arx(a=[-0.9], b=[0.1]), np.ones(3), FAST, Softening(k3=0.1))


def two_modes(period: float, share: float = 0.8) -> tuple[Arx, np.ndarray]:
    """A sum of a mode at 300 Hz with `share` of the static displacement and one at 900 Hz, and both denominators."""
    modes = []
    for frequency, zeta in ((300.0, 0.02), (900.0, 0.03)):
        rate = 2 * np.pi * frequency
        poles = np.exp(rate * period * (-zeta + 1j * np.sqrt(1 - zeta**2)))
        modes.append(np.poly([poles, poles.conjugate()]).real)
    first, second = modes
    b = share * first.sum() * second + (1.0 - share) * second.sum() * first
    return Arx(a=polynomial.polymul(first, second)[1:], b=b, delay=2), np.array(modes)


@pytest.mark.parametrize("k3", [0.0, 0.2])
def test_softening_of_one_mode_does_not_change_the_other(k3: float) -> None:
    period, share = 2e-5, 0.8
    arx, (first, second) = two_modes(period, share)
    w = np.concatenate((np.zeros(5), np.random.default_rng(3).normal(0.0, 0.5, 3000)))
    x, z = np.zeros(w.size), np.zeros(w.size)
    for i in range(w.size):
        before, earlier = (x[i - 1], x[i - 2]) if i > 1 else (0.0, 0.0)
        x[i] = first.sum() * (w[i] - k3 * before**3) - first[1] * before - first[2] * earlier
    z = signal.lfilter([second.sum()], second, w)
    expected = np.concatenate((np.zeros(2), (share * x + (1.0 - share) * z)[:-2]))
    y = run(arx, w, Discretisation(period, period), SofteningOfOneMode(k3=k3))
    np.testing.assert_allclose(y, expected, atol=1e-9)


def test_one_softened_mode_of_two_settles_with_its_share() -> None:
    period, share, k3 = 2e-5, 0.8, 0.03
    arx, _ = two_modes(period, share)
    x = np.concatenate((np.zeros(5), np.full(60000, 0.8)))
    (deflection,) = [r.real for r in np.roots([k3, 0.0, 1.0, -0.8]) if abs(r.imag) < 1e-12 and 0 < r.real < 1]
    for setting in (Discretisation(period, period), Discretisation(1e-3, period)):
        y = run(arx, x, setting, SofteningOfOneMode(k3=k3))
        assert y[-1] == pytest.approx(share * deflection + (1.0 - share) * 0.8, rel=1e-7)


def test_two_forms_of_softening_are_refused() -> None:
    with pytest.raises(ModelError, match="2 forms of softening"):
        run(two_modes(2e-5)[0], np.ones(3), FAST, Softening(k3=0.1), SofteningOfOneMode(k3=0.1))


def test_a_double_mode_is_refused() -> None:
    once = np.array([1.0, -1.0, 0.5])
    with pytest.raises(ModelError, match="is double"):
        share_of_mode(polynomial.polymul(once, once)[1:], np.ones(4), once[1:], once[1:], np.eye(4))


def test_a_delay_below_one_sample_is_that_of_a_smooth_drive() -> None:
    u = np.sin(2 * np.pi * np.arange(400) / 100)
    block = Arx(b=[1.0], delay=0.3).block(Discretisation(1e-3, 1e-3))
    y, _ = block.run(u, block.rest(0.0, 0.0))
    assert np.abs(y - np.sin(2 * np.pi * (np.arange(400) - 0.3) / 100))[10:].max() < 1e-5
