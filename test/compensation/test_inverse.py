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

"""The inverse under limits, from the middle of a motion, and with zeros that no causal filter inverts."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from piezo_hysteresis.blocks.inverses.factors import factors, preview_taps, zero_phase_taps
from piezo_hysteresis.blocks.inverses.linear_inverse import LinearInverse
from piezo_hysteresis.compensation import Band, Inverse, Limits, plan
from piezo_hysteresis.compensation.approach import smooth_transition
from piezo_hysteresis.effects import (
    AmplifierBandwidth,
    Arx,
    Backlash,
    BoucWen,
    Creep,
    Effect,
    ExtraResonance,
    HysteresisMemory,
)
from piezo_hysteresis.errors import ModelError, StageError
from piezo_hysteresis.model.model import Model

from .published import ARX, PERIOD, stage, swing, triangle


def test_limits_hold_for_every_sample_and_the_state_follows_them() -> None:
    model = stage(Creep(gamma=0.01))
    limits = Limits(0.0, 5.0, 4e3)
    y = swing(50.0, 0.0, 12e-6, 3)
    inverse = Inverse(model, limits)
    u, _ = inverse.command(y, inverse.rest(0.0))
    assert u.min() >= 0.0 and u.max() <= 5.0
    assert np.abs(np.diff(u)).max() <= 4e3 * PERIOD * (1.0 + 1e-12)
    reached = model.run(u, model.rest(0.0))[0][inverse.preview :]
    off = np.abs(reached - y)
    needed, _ = Inverse(model).command(y, Inverse(model).rest(0.0))
    assert needed.max() > 5.0 and needed.min() < 0.0 and off.max() > 1e-7
    free = (y > 3e-6) & (y < 7e-6) & (np.arange(y.size) > 600)
    assert free.any() and off[free].max() < 2e-10, "between the limits it is on the path again"


def test_slow_poles_and_zeros_near_one_are_inverted_by_the_recursion() -> None:
    a, b = np.poly([0.9998, 0.9, 0.5]), np.poly([0.99985, 0.3])
    model = Model((BoucWen(), Arx(a=a[1:], b=0.05 * b, delay=2)), PERIOD, 10.0, 1e-5)
    inverse = Inverse(model)
    assert inverse.preview == 2 and inverse.is_exact
    y, _ = model.run(1.0 - np.cos(np.arange(20000) / 500.0), model.rest(0.0))
    u, _ = inverse.command(y, inverse.rest(0.0))
    np.testing.assert_allclose(model.run(u, model.rest(0.0))[0][2:], y, rtol=0.0, atol=1e-9 * np.ptp(y))


@pytest.mark.parametrize("zero", [1.02, 1.2, -1.5, -6.0])
def test_a_zero_outside_the_circle_is_inverted_by_preview(zero: float) -> None:
    ahead, taps = preview_taps(np.array([1.0, -zero]))
    whole = np.convolve(taps, [1.0, -zero])
    np.testing.assert_allclose(whole, np.eye(1, whole.size, ahead)[0], atol=1e-13 * np.abs(taps).max())


def test_zeros_at_the_circle_are_inverted_in_the_band() -> None:
    ahead, taps = zero_phase_taps(np.array([0.5, 0.5]))
    inverse = LinearInverse((np.array([0.5, 0.5]), np.ones(1)), 1.0, "mean of two")
    assert not inverse.is_exact and inverse.preview == ahead
    assert inverse.error(np.array([0.0, 400.0]), PERIOD).max() < 1e-12
    assert inverse.error(np.array([4000.0]), PERIOD)[0] < 1e-9
    assert abs(taps.sum() - 1.0) < 1e-12


def test_factors_multiply_back() -> None:
    rng = np.random.default_rng(3)
    for _ in range(50):
        b = np.concatenate((np.zeros(2), rng.normal(size=9)))
        found = factors(b)
        back = np.convolve(np.convolve(found.inside, found.outside), found.near)
        np.testing.assert_allclose(back, b[found.delay :], atol=1e-10 * np.abs(b).max())


def test_a_lightly_damped_resonance_does_not_ring() -> None:
    model = stage(ExtraResonance(r=0.3, f0=1200.0, zeta=0.01))
    inverse = Inverse(model, band=Band())
    y = triangle(100.0, 1e-6, 5e-6, 4)
    u, _ = inverse.command(np.concatenate((np.full(300, y[0]), y)), inverse.rest(_voltage_at(model, y[0])))
    reached, _ = model.run(u, model.rest(_voltage_at(model, y[0])))
    off = reached[inverse.preview + 300 :] - y
    rms = np.sqrt(np.mean(off[: y.size - 200] ** 2)) / np.ptp(y)
    assert rms < 1e-3


def test_rounding_of_a_constant_path_does_not_reverse_a_backlash() -> None:
    model = stage(Backlash(b=0.05), AmplifierBandwidth(tau=1e-5))
    limits = Limits(0.0, 10.0)
    levels = (3e-6, 5e-6, 7e-6, 5e-6, 3e-6)
    held = [np.append(smooth_transition(a, b, 250), np.full(2000, b)) for a, b in itertools.pairwise(levels)]
    wanted = np.concatenate(held)
    found = plan(model, wanted, limits)
    jumps = np.abs(np.diff(found.voltage)) > 0.05
    assert 1 <= jumps.sum() < 20, "the drive jumps where the path turns, not while it is held"
    assert found.expected.planned < 1e-4 * found.range
    chattering, _ = Inverse(model, limits).command(wanted, Inverse(model, limits).rest(0.0))
    assert (np.abs(np.diff(chattering)) > 0.05).sum() > jumps.sum()


def test_it_continues_from_the_middle_of_a_motion() -> None:
    model = stage(Creep(gamma=0.01), HysteresisMemory(c=(0.05,) * 8))
    drive = np.concatenate((3.0 * (1.0 - np.cos(np.arange(2000) / 60.0)), np.full(3000, 4.0)))
    y0, state = model.run(drive, model.rest(0.0))
    inverse = Inverse(model)
    y = y0[-1] + 1e-6 * (1.0 - np.cos(np.arange(2000) / 50.0))
    u, _ = inverse.command(y, inverse.resume(state))
    reached, _ = model.run(u, state)
    off = reached[inverse.preview :] - y
    assert np.abs(off).max() < 5e-4 * np.ptp(y), "only what creeps counts as settled"
    wrong, _ = model.run(inverse.command(y, inverse.rest(4.0))[0], state)
    assert np.abs(wrong[inverse.preview :] - y).max() > 20 * np.abs(off).max()


@pytest.mark.parametrize("samples", [0.01, 0.02, 0.026, 0.03, 0.5])
def test_a_pole_much_faster_than_a_sample_is_inverted_too(samples: float) -> None:
    """Its response within the sample has ended, but the ramp between two samples comes later by its time constant."""
    model = Model((AmplifierBandwidth(tau=samples * 1e-3), BoucWen(), Arx(b=[0.5], delay=1)), 1e-3)
    inverse = Inverse(model)
    u = 4.0 - 4.0 * np.cos(2.0 * np.pi * 100.0 * 1e-3 * np.arange(300))
    y, _ = model.run(u, model.rest(u[0]))
    command, _ = inverse.command(y, inverse.rest(u[0]))
    reached, _ = model.run(command, model.rest(u[0]))
    assert inverse.is_exact
    np.testing.assert_allclose(reached[inverse.preview :], y, rtol=0.0, atol=1e-12 * np.ptp(y))


def test_preview_is_reported_in_samples_and_seconds() -> None:
    inverse = Inverse(Model((BoucWen(), Arx(b=[0.5], delay=5)), PERIOD))
    assert (inverse.preview, inverse.preview_time) == (5, pytest.approx(1e-4))
    assert Inverse(stage(), band=Band()).preview == Inverse(stage()).preview + 100


def test_invalid_values_are_refused() -> None:
    with pytest.raises(ModelError, match="gain at dc is 0"):
        Inverse(Model((BoucWen(), Arx(b=[1.0, -1.0])), PERIOD))
    with pytest.raises(ModelError, match="static"):
        Inverse(Model((BoucWen(p2=0.0), ARX), PERIOD))
    with pytest.raises(StageError, match="minimum below"):
        Limits(1.0, 0.0)
    assert Limits(0.0, 10.0).resolved.resolution == pytest.approx(5e-4)
    assert Limits(0.0, 10.0, resolution=0.0).resolved.resolution == 0.0
    with pytest.raises(StageError, match="slew"):
        Limits(max_slew_rate=0.0)
    with pytest.raises(StageError, match="resolution"):
        Limits(resolution=-1.0)
    with pytest.raises(ModelError, match="band"):
        Band(2e3, 1e3)
    inverse = Inverse(stage())
    with pytest.raises(ModelError, match="finite"):
        inverse.run([0.0, np.nan], inverse.rest(0.0))
    with pytest.raises(ModelError, match="rest: got nan V"):
        inverse.rest(np.nan)
    for length in (-1.0, np.nan):
        with pytest.raises(ModelError, match="band: got a length"):
            Band(1e3, 2e3, length)


def _voltage_at(model: Model, y: float) -> float:
    """Rest voltage of a displacement, by bisection."""
    low, high = 0.0, 8.0
    for _ in range(60):
        middle = 0.5 * (low + high)
        at, _ = model.run([middle], model.rest(middle))
        low, high = (middle, high) if at[0] < y else (low, middle)
    return low


def creeping_dynamics() -> Arx:
    """Fast poles and creep of 3 % in 50 ms, as an identification finds it that fits no effect of creep."""
    slow = np.exp(-PERIOD / 0.05)
    zeros = np.polyadd(np.poly([slow, 0.3]), 0.03 * (1.0 - slow) * np.poly([0.3]))
    return Arx(a=np.poly([slow, 0.85, 0.8])[1:], b=zeros * 0.03 / 0.7, delay=3)


@pytest.mark.parametrize("waited", [0.0, 0.01, 0.1])
@pytest.mark.parametrize("added", [(), (AmplifierBandwidth(tau=1e-4), ExtraResonance(r=0.1, f0=1200.0, zeta=0.01))])
def test_a_path_after_another_begins_without_a_kick(waited: float, added: tuple[Effect, ...]) -> None:
    """The dynamics were taken as settled: the drive began with a step for 120 nm, and a level was 44 nm wrong."""
    model = Model((BoucWen(), creeping_dynamics(), *added), PERIOD, 10.0, 4e-5)
    limits = Limits(-2.0, 12.0)
    before = plan(model, swing(20.0, 1e-6, 8e-6, 1.5), limits)
    state = before.end
    if waited:
        _, state = model.run(np.full(round(waited / PERIOD), state.inputs[0]), state)
    y = np.full(2000, 9e-6)
    found = plan(model, y, limits, start=state)
    at = float(model.run([state.inputs[0]], state)[0][0])
    way = smooth_transition(at, y[0], found.begin - found.preview)
    assert np.abs(found.predicted[found.preview : found.begin] - way).max() < 1e-9
    assert np.abs(found.path_predicted - y).max() < 1e-10
    inverse = Inverse(model, limits, band=found.band)
    begun = inverse.resume(state)
    whole, _ = inverse.run(np.append(way, y), begun)
    parts, now = [], begun
    for block in np.array_split(np.append(way, y), 7):
        u, now = inverse.run(block, now)
        parts.append(u)
    assert np.array_equal(np.concatenate(parts), whole)
