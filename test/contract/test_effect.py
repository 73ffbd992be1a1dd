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

"""What every effect of the catalogue promises, whatever it does."""

from __future__ import annotations

import contextlib
import importlib
import itertools
import pkgutil
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from piezo_hysteresis import blocks, effects
from piezo_hysteresis.blocks.kernel import fma
from piezo_hysteresis.blocks.time import TimeBlock
from piezo_hysteresis.effects import (
    CATALOGUE,
    CHAIN,
    Arx,
    BoucWen,
    Creep,
    Effect,
    HysteresisExponent,
    HysteresisMemory,
    Offset,
    PublishedBoucWen,
    RateDependentHysteresis,
    RateDependentHysteresisLagged,
    Softening,
    SofteningOfOneMode,
    ThermalDrift,
)
from piezo_hysteresis.errors import DivergenceError, ParameterError
from piezo_hysteresis.model.model import Model

PERIOD = 1e-4
N = 400
UNUSUAL = {
    "amplifier_slew_limit": {"S": 2e3},
    "amplifier_slew_limit_held": {"S": 2e3, "late": 0.3},
    "amplifier_slew_limit_settling": {"S": 2e3},
    "rate_dependent_hysteresis_lagged": {"tau": 3e-4},
    "amplifier_saturation": {"lower": 1.4, "upper": 4.4},
    "hysteresis_memory": {"virgin": 1.0, "turns": (0.6, 0.1)},
}
"""Sizes of effects that are not off at a finite small value."""

NORMALISED = (RateDependentHysteresis, RateDependentHysteresisLagged, HysteresisExponent)
"""Their reference speed or state is one of the normalised drive, so that they depend on its scale."""

MAY_DIVERGE = (PublishedBoucWen, Softening, SofteningOfOneMode)
"""At their bounds the explicit step is unstable, and the stiffness vanishes under the drive; both are reported."""


def typical(kind: type[Effect]) -> Effect:
    """The effect at a size that shows."""
    values = dict(UNUSUAL.get(kind.name, {}))
    for row in kind.parameters:
        if row.name not in values and row.off is not None and kind is not Offset:
            size = row.off + row.scale
            values[row.name] = (size,) * len(row.value) if row.is_array else size
    return kind(**values)


def model_with(*added: Effect) -> Model:
    """The published chain in small, with the effects `added`."""
    base = [BoucWen(), Arx(a=[-1.2, 0.6], b=[0.3, 0.1], delay=2), Offset(y0=1e-7)]
    if any(isinstance(e, PublishedBoucWen) for e in added):
        base.pop(0)
    if any(e.host == HysteresisMemory.name for e in added):
        base.append(typical(HysteresisMemory))
    model = Model(tuple(base), PERIOD, voltage_scale=10.0, displacement_scale=1e-5)
    for effect in added:
        model = model.with_effect(effect)
    return model


def drive(n: int = N, seed: int = 1) -> np.ndarray:
    """Swings, holds and a step [V]."""
    rng = np.random.default_rng(seed)
    u = 3.0 + 2.0 * np.sin(np.arange(n) / 15.0) + rng.normal(scale=0.05, size=n)
    u[n // 2 : n // 2 + 40] = 4.5
    return u


def channels(n: int = N) -> dict[str, np.ndarray]:
    return {"other_displacement": 1e-6 * np.sin(np.arange(n) / 9.0), "temperature": 293.15 + np.arange(n) / n}


def run(model: Model, u: np.ndarray, period: float = PERIOD, cuts: tuple[int, ...] = ()) -> np.ndarray:
    """Free run from rest at the first voltage, in blocks."""
    chain = model.at(period)
    state = chain.rest(u[0], 0.0)
    edges = [0, *sorted({c for c in cuts if 0 < c < u.size}), u.size]
    parts = []
    for a, b in itertools.pairwise(edges):
        y, state = chain.run(u[a:b].copy(), state, {k: v[a:b].copy() for k, v in channels(u.size).items()})
        parts.append(y)
    return np.concatenate(parts)


def sensitivities(
    model: Model, u: np.ndarray, names: list[str], period: float = PERIOD, cuts: tuple[int, ...] = ()
) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Free run with sensitivities, in blocks."""
    chain = model.at(period)
    state, tangent = chain.rest(u[0], 0.0), chain.rest_tangent(u[0], names)
    edges = [0, *sorted({c for c in cuts if 0 < c < u.size}), u.size]
    outputs, slopes = [], []
    for a, b in itertools.pairwise(edges):
        here = {k: v[a:b].copy() for k, v in channels(u.size).items()}
        y, order, s, state, tangent = chain.linearise(u[a:b].copy(), state, tangent, names, here)
        outputs.append(y)
        slopes.append(s)
    return np.concatenate(outputs), dict(zip(order, np.concatenate(slopes, axis=1), strict=True))


def fitted_names(effect: Effect) -> list[str]:
    """Numbers of an effect that have a sensitivity."""
    fixed = {p.name for p in effect.parameters if p.fixed}
    return [f"{effect.name}.{n}" for n in effect.free_names() if n.partition("[")[0] not in fixed]


def difference(model: Model, u: np.ndarray, name: str, period: float) -> tuple[np.ndarray, np.ndarray]:
    """Finite difference of the free run, one-sided at a bound, and half its jump within the step at every sample.

    The jump is large only at a sample at a kink of a law, where the derivative is that of either side.
    """
    row, at = model.row(name), model.values()[name]
    h = 1e-5 * row.scale
    weights = _stencil(row, at, h)
    moved = {k: run(model.with_values({name: at + k * h}), u, period) for k in weights}
    jump = np.diff([moved[k] for k in sorted(moved)], n=2, axis=0)[0] / h
    return sum(w * moved[k] for k, w in weights.items()) / h, 0.5 * np.abs(jump)


def _stencil(row, at: float, h: float) -> dict[int, float]:
    if at - h < row.lower:
        return {0: -1.5, 1: 2.0, 2: -0.5}
    if at + h > row.upper:
        return {0: 1.5, -1: -2.0, -2: 0.5}
    return {-1: -0.5, 0: 0.0, 1: 0.5}


every_effect = pytest.mark.parametrize("kind", CHAIN, ids=lambda kind: kind.name)


def rounded_once(x: float, y: float, z: float) -> float:
    """x y + z, in rational numbers before it is rounded."""
    return float(Fraction(x) * Fraction(y) + Fraction(z))


@pytest.fixture
def plain_python(monkeypatch: pytest.MonkeyPatch) -> None:
    """Every kernel replaced by the Python function it was compiled from, with an `fma` that rounds once as theirs."""
    rooms = (pkgutil.walk_packages(room.__path__, f"{room.__name__}.") for room in (blocks, effects))
    modules = [info.name for room in rooms for info in room]
    for module in map(importlib.import_module, modules):
        for name, value in vars(module).copy().items():
            if hasattr(value, "py_func"):
                monkeypatch.setattr(module, name, value.py_func)
            elif value is fma:
                monkeypatch.setattr(module, name, rounded_once)


@every_effect
@settings(max_examples=8, suppress_health_check=[HealthCheck.too_slow])
@given(cuts=st.lists(st.integers(1, N - 1), max_size=8).map(tuple))
def test_every_cutting_gives_the_same_bits(kind: type[Effect], cuts: tuple[int, ...]) -> None:
    model = model_with(typical(kind))
    for period in (PERIOD, 50 * PERIOD):
        np.testing.assert_array_equal(run(model, drive(), period, cuts), run(model, drive(), period))


@every_effect
def test_sample_by_sample_gives_the_same_bits(kind: type[Effect]) -> None:
    model = model_with(typical(kind))
    np.testing.assert_array_equal(run(model, drive(), PERIOD, tuple(range(N))), run(model, drive()))


@every_effect
def test_linearise_gives_the_same_bits_as_run(kind: type[Effect]) -> None:
    effect = typical(kind)
    model = model_with(effect)
    whole, slopes = sensitivities(model, drive(), fitted_names(effect))
    cut, parts = sensitivities(model, drive(), fitted_names(effect), cuts=(1, 7, 200))
    np.testing.assert_array_equal(whole, run(model, drive()))
    np.testing.assert_array_equal(cut, whole)
    for name in slopes:
        np.testing.assert_array_equal(parts[name], slopes[name])


@every_effect
def test_compiled_equals_plain_python(kind: type[Effect], request: pytest.FixtureRequest) -> None:
    effect = typical(kind)
    u, names = drive(120), fitted_names(effect)
    y, slopes = sensitivities(model_with(effect), u, names)
    free = run(model_with(effect), u)
    request.getfixturevalue("plain_python")
    plain, plain_slopes = sensitivities(model_with(effect), u, names)
    np.testing.assert_array_equal(plain, y)
    np.testing.assert_array_equal(run(model_with(effect), u), free)
    for name in names:
        np.testing.assert_array_equal(plain_slopes[name], slopes[name])


@pytest.mark.parametrize("kind", [*CATALOGUE, Offset], ids=lambda kind: kind.name)
@pytest.mark.parametrize("period", [PERIOD, 50 * PERIOD], ids=["fast", "slow"])
def test_off_is_exactly_absent(kind: type[Effect], period: float) -> None:
    effect = typical(kind).off()
    assert effect.is_off
    model = model_with(effect)
    if kind is not Offset:
        assert not typical(kind).is_off
        assert np.ptp(run(model_with(typical(kind)), drive(), PERIOD) - run(model, drive(), PERIOD)) > 0
    np.testing.assert_array_equal(run(model, drive(), period), run(model.without(kind.name), drive(), period))


def is_function_of_time(kind: type[Effect]) -> bool:
    return any(isinstance(block, TimeBlock) for block in model_with(typical(kind)).at(PERIOD).blocks)


@pytest.mark.parametrize("kind", [k for k in CHAIN if not is_function_of_time(k)], ids=lambda kind: kind.name)
@pytest.mark.parametrize("voltage", [0.0, 3.7, -2.1])
def test_rest_stays_at_rest(kind: type[Effect], voltage: float) -> None:
    for period in (PERIOD, 50 * PERIOD):
        chain = model_with(typical(kind)).at(period)
        y, _ = chain.run(np.full(50, voltage), chain.rest(voltage))
        np.testing.assert_array_equal(y, np.full(50, y[0]))
        x = voltage
        for block in chain.blocks:
            x = block.static(x)
        np.testing.assert_allclose(y[0], x, rtol=1e-13)


@every_effect
def test_finite_at_the_corners_of_the_bounds(kind: type[Effect]) -> None:
    u, checked = 3.0 + 0.5 * np.sin(np.arange(100) / 10.0), 0
    for corner in itertools.product(*((p.lower, p.upper) for p in kind.parameters)):
        rows = zip(kind.parameters, corner, strict=True)
        values = {p.name: (c,) * max(1, len(p.value)) if p.is_array else c for p, c in rows}
        try:
            model = model_with(kind(**values))
        except ParameterError:
            continue
        checked += 1
        for period in (PERIOD, 50 * PERIOD):
            if kind in MAY_DIVERGE:
                with contextlib.suppress(DivergenceError):
                    run(model, u, period)
            else:
                assert np.isfinite(run(model, u, period)).all(), values
    assert checked or kind is Arx


@every_effect
@pytest.mark.parametrize("period", [PERIOD, 50 * PERIOD], ids=["fast", "slow"])
@pytest.mark.parametrize("size", ["typical", "off"])
def test_sensitivities_equal_finite_differences(kind: type[Effect], period: float, size: str) -> None:
    effect = typical(kind)
    if size == "off":
        effect = effect.off()
    neighbours = [typical(k) for k in (Creep, ThermalDrift) if k is not kind]
    model = model_with(*neighbours, effect)
    names = fitted_names(effect) + [f"{n.name}.{p}" for n in neighbours for p in ("gamma", "D") if p in n.values]
    names += [n for n in ("bouc_wen.beta", "bouc_wen.p2", "arx.b[0]") if n in model.values() and n not in names]
    _, slopes = sensitivities(model, drive(), names, period)
    assert set(slopes) == set(names)
    for name in names:
        expected, jump = difference(model, drive(), name, period)
        floor = 1e-9 * model.displacement_scale / model.row(name).scale
        tolerance = 2e-4 * np.abs(expected) + 2e-5 * np.abs(expected).max() + floor + jump
        np.testing.assert_array_less(np.abs(slopes[name] - expected), tolerance, err_msg=name)


@every_effect
def test_the_parameter_table_is_complete(kind: type[Effect]) -> None:
    assert kind.equation and kind.signature and kind.source and kind.family
    doc = kind.__doc__ or ""
    assert "Parameters\n" in doc
    for row in kind.parameters:
        assert row.meaning and row.source
        assert row.name in doc, row.name
        assert row.unit == "1" or row.unit in doc, f"{row.name}: unit {row.unit}"


@pytest.mark.parametrize("kind", [k for k in CHAIN if k not in NORMALISED], ids=lambda kind: kind.name)
def test_physical_quantities_do_not_depend_on_the_scales(kind: type[Effect]) -> None:
    model = model_with(typical(kind))
    volts, metres = 0.7, 1.6
    rows = {name: model.row(name) for name in model.values()}
    values = {n: v * volts ** -rows[n].powers[0] * metres ** -rows[n].powers[1] for n, v in model.values().items()}
    scales = volts * model.voltage_scale, metres * model.displacement_scale
    other = Model(model.effects, PERIOD, *scales).with_values(values)
    expected = run(model, drive())
    np.testing.assert_allclose(run(other, drive()), expected, rtol=0.0, atol=1e-9 * np.ptp(expected))


def test_names_are_unique() -> None:
    names = [kind.name for kind in CHAIN]
    assert len(set(names)) == len(names)
