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

"""What every effect says about its own inverse, and that it is true."""

from __future__ import annotations

import contextlib
import itertools

import numpy as np
import pytest

from piezo_hysteresis.blocks.block import Block, MemorylessBlock
from piezo_hysteresis.blocks.inverses.inverted_block import InvertedBlock
from piezo_hysteresis.compensation import Inverse, Limits, plan
from piezo_hysteresis.effects import (
    CHAIN,
    UNNAMED,
    AmplifierBandwidth,
    AmplifierBandwidthHeld,
    AmplifierSlewLimitHeld,
    Arx,
    BoucWen,
    ChainPosition,
    Creep,
    Discretisation,
    Effect,
    HysteresisMemory,
    Invertibility,
    Offset,
    PublishedBoucWen,
    RateDependentHysteresis,
    RateDependentHysteresisLagged,
    SensorBandwidth,
)
from piezo_hysteresis.errors import DivergenceError, ModelError, ParameterError
from piezo_hysteresis.model.model import Model
from piezo_hysteresis.parameter import Parameter, Value

PERIOD = 2e-5
N = 1500
WORST = 1e9
"""Largest growth of rounding in the dynamics at which a path still says something."""
TYPICAL: dict[str, dict[str, Value]] = {
    "amplifier_slew_limit": {"S": 1e5},
    "amplifier_slew_limit_held": {"S": 1e5},
    "amplifier_slew_limit_settling": {"S": 1e5, "tau": 1e-5},
    "amplifier_saturation": {"lower": -3.0, "upper": 4.4, "corner": 0.5},
    "hysteresis_memory": {"virgin": 1.0, "turns": (0.6, 0.1)},
    "rate_dependent_hysteresis": {"k": 0.01, "a": 0.1},
    "rate_dependent_hysteresis_lagged": {"k": 0.01, "a": 0.1, "tau": 2e-4},
    "arx": {},
}

APPROXIMATED = {
    "extra_delay": ("tau", (1e-5, 3e-5, 1e-3), 1e-4),
    "amplifier_slew_limit_held": ("S", (1e4, 3e4, 1e5), 3e-3),
    "amplifier_slew_limit_settling": ("S", (1e4, 3e4, 1e5), 3e-3),
    "rate_dependent_hysteresis_lagged": ("tau", (2e-5, 2e-4, 2e-3), 3e-3),
}
"""Sizes of effects that are inverted with an error, and its largest share of the range."""

every_effect = pytest.mark.parametrize("kind", CHAIN, ids=lambda kind: kind.name)


def kinds(invertibility: Invertibility) -> list[type[Effect]]:
    """Effects of the catalogue with this kind of inverse."""
    return [kind for kind in CHAIN if kind.invertibility is invertibility]


exact = kinds(Invertibility.EXACT)


def typical(kind: type[Effect]) -> Effect:
    """The effect at a size that shows."""
    values = dict(TYPICAL.get(kind.name, {}))
    for row in kind.parameters:
        if row.name not in values and row.off is not None:
            size = row.off + row.scale
            values[row.name] = (size,) * len(row.value) if row.is_array else size
    return kind(**values)


def model_with(*added: Effect) -> Model:
    """A chain with a resonance, a zero outside the unit circle and a delay, and the effects `added`."""
    names = {e.name for e in added}
    base: list[Effect] = [Arx(a=[-1.2, 0.6], b=[0.1, 0.3, 0.1], delay=2), Offset(y0=1e-7)]
    if not names & {PublishedBoucWen.name}:
        base.append(BoucWen())
    if any(e.host == HysteresisMemory.name for e in added):
        base.append(typical(HysteresisMemory))
    model = Model(tuple(e for e in base if e.name not in names), PERIOD, 10.0, 1e-5)
    for effect in added:
        model = model.with_effect(effect)
    return model


def drive() -> np.ndarray:
    """Swings with minor loops, a hold, and back to rest [V]."""
    t = np.arange(N) * PERIOD
    u = 1.5 * (1.0 - np.cos(2 * np.pi * 120.0 * t)) + 0.4 * (1.0 - np.cos(2 * np.pi * 700.0 * t))
    return np.concatenate((u, np.full(N // 5, u[-1])))


def mismatch(model: Model, inverse: Inverse) -> float:
    """Largest deviation of run(inverse(y)) from a reachable y, as a share of the largest |y|."""
    y, _ = model.run(drive(), model.rest(0.0))
    u, _ = inverse.command(y, inverse.rest(0.0))
    reached, _ = model.run(u, model.rest(0.0))
    end = y.size - inverse.preview  # at the end of the path the future is missing
    return float(np.abs(reached[inverse.preview :] - y)[:end].max() / max(np.abs(y).max(), 1e-12))


@every_effect
def test_declares_it_in_its_own_class(kind: type[Effect]) -> None:
    assert isinstance(vars(kind).get("invertibility"), Invertibility), kind.name


@pytest.mark.parametrize("kind", exact, ids=lambda kind: kind.name)
def test_exact_is_exact_to_rounding(kind: type[Effect]) -> None:
    model = model_with(typical(kind))
    inverse = Inverse(model)
    assert inverse.is_exact
    assert mismatch(model, inverse) < 1e-12


def is_well_posed(model: Model) -> bool:
    """Whether w grows with v on every branch of the drive, so that one v belongs to every w.

    Read off the model itself: the hysteresis output of the test drive falls nowhere while v rises, nor rises while it
    falls.
    """
    chain = model.at(PERIOD)
    scale = chain.labels.index("voltage_scale")
    x, w = drive(), drive()
    for k, block in enumerate(chain.blocks):
        before = w
        w, _ = block.run(w, block.rest(float(w[0]), 0.0))
        if k == scale + 1:
            x = before
            break
    dv, dw = np.diff(x), np.diff(w)
    moving = np.abs(dv) > 1e-9
    slopes = dw[moving] / dv[moving]
    return bool((slopes > 1e-3).all() or (slopes < -1e-3).all())


@pytest.mark.parametrize("kind", [k for k in exact if k is not Arx], ids=lambda kind: kind.name)
def test_exact_at_the_corners_of_the_bounds(kind: type[Effect]) -> None:
    checked = 0
    for corner in itertools.product(*((p.lower, p.upper) for p in kind.parameters)):
        rows = zip(kind.parameters, corner, strict=True)
        values = {p.name: (c,) * max(1, len(p.value)) if p.is_array else c for p, c in rows}
        with contextlib.suppress(ParameterError, DivergenceError, ModelError):
            steep = [BoucWen(p2=8.0)] if kind.host == BoucWen.name else []  # so that every h0 is one that can be
            model = model_with(*steep, kind(**values))
            inverse = Inverse(model)
            if not is_well_posed(model) or inverse.noise_gain > WORST or not inverse.is_exact:
                continue
            checked += 1
            assert mismatch(model, inverse) < 1e-16 * inverse.noise_gain + 1e-9, values
    assert checked


@pytest.mark.parametrize("kind", kinds(Invertibility.APPROXIMATE), ids=lambda kind: kind.name)
def test_approximate_is_good_in_the_band(kind: type[Effect]) -> None:
    name, sizes, allowed = APPROXIMATED[kind.name]
    for size in sizes:
        inverse = Inverse(model_with(kind(**{name: size})))
        assert mismatch(inverse.model, inverse) < allowed


@pytest.mark.parametrize("kind", kinds(Invertibility.NOT_NEEDED), ids=lambda kind: kind.name)
def test_effects_outside_the_drive_path_do_not_change_the_command(kind: type[Effect]) -> None:
    model = model_with(typical(kind))
    inverse, without = Inverse(model), Inverse(model.without(kind.name))
    y, _ = without.model.run(drive(), without.model.rest(0.0))
    np.testing.assert_array_equal(inverse.run(y, inverse.rest(0.0))[0], without.run(y, without.rest(0.0))[0])
    assert inverse.not_on_path == (kind.name,)


@pytest.mark.parametrize("kind", kinds(Invertibility.IMPOSSIBLE), ids=lambda kind: kind.name)
def test_impossible_is_refused_by_name_or_left_out(kind: type[Effect]) -> None:
    model = model_with(typical(kind))
    with pytest.raises(ModelError, match=kind.name):
        Inverse(model)
    inverse = Inverse(model, approximate=True)
    assert inverse.left_out == (kind.name,) and not inverse.is_exact
    assert Inverse(model_with(typical(kind).off())).left_out == (), "off, it is not missed"


@pytest.mark.parametrize("kind", kinds(Invertibility.IMPOSSIBLE), ids=lambda kind: kind.name)
def test_the_effects_after_one_that_is_left_out_start_from_their_own_states(kind: type[Effect]) -> None:
    drives = []
    for after in ((), (Offset(y0=1e-7, settling=0.1), SensorBandwidth(tau=1e-4))):
        model = model_with(typical(kind), *after)
        if not after:
            model = model.without(Offset.name)
        inverse, start = Inverse(model, approximate=True), model.rest(3.0)
        reading = np.full(100, model.run([3.0], start)[0][0])
        drives.append(inverse.run(reading, inverse.resume(start))[0])
        np.testing.assert_array_equal(inverse.run(reading, inverse.rest(3.0))[0], drives[-1])
    np.testing.assert_allclose(drives[1], drives[0], rtol=1e-9)


@pytest.mark.parametrize("kind", UNNAMED, ids=lambda kind: kind.name)
def test_a_drive_without_a_correction_continues_from_the_present_voltage(kind: type[Effect]) -> None:
    model = model_with(typical(kind))
    _, now = model.run(np.append(np.linspace(0.0, 5.0, 500), np.full(5000, 3.0)), model.rest(0.0))
    reading = np.full(100, model.run([3.0], now)[0][0])
    drive = plan(model, reading, Limits(0.0, 10.0), start=now, approximate=True).voltage
    np.testing.assert_allclose(drive, 3.0, rtol=0.0, atol=0.01)


@every_effect
def test_every_cutting_gives_the_same_bits(kind: type[Effect]) -> None:
    model = model_with(typical(kind))
    inverse = Inverse(model, approximate=True)
    y, _ = model.run(drive(), model.rest(0.0))
    whole, _ = inverse.run(y, inverse.rest(0.0))
    for edges in ((0, 1, 2, 37, 500, 501, y.size), (*range(0, 300), y.size)):
        state, parts = inverse.rest(0.0), []
        for a, b in itertools.pairwise(edges):
            u, state = inverse.run(y[a:b], state)
            parts.append(u)
        np.testing.assert_array_equal(np.concatenate(parts), whole)


class OwnSensor(Effect):
    """A sensor outside the package."""

    name = "own_sensor"
    invertibility = Invertibility.EXACT
    family = "static"
    place = ChainPosition.SENSOR
    equation = "y = sinh(k x)/k"
    signature = "harmonics"
    source = "none"
    parameters = (Parameter("k", "k", "1", 0.3, 0.1, 1.0, "bend", "none"),)

    def block(self, setting: Discretisation, terms: tuple[Effect, ...] = ()) -> Block:
        return OwnSensorBlock(self["k"])


class OwnSensorBlock(MemorylessBlock):
    """sinh(k x)/k."""

    names = ("own_sensor.k",)

    def __init__(self, k: float) -> None:
        self.k = k

    def value(self, x: np.ndarray) -> np.ndarray:
        return np.sinh(self.k * x) / self.k

    def slope(self, x: np.ndarray) -> np.ndarray:
        return np.cosh(self.k * x)

    def by_parameter(self, x: np.ndarray) -> np.ndarray:
        return (x * np.cosh(self.k * x) - self.value(x))[np.newaxis, :] / self.k

    def inverted(self, name: str) -> InvertedBlock:
        return InvertedOwnSensor(self.k)


class InvertedOwnSensor(InvertedBlock):
    """arsinh(k y)/k."""

    def __init__(self, k: float) -> None:
        self.k = k

    def run(self, y: np.ndarray, state: object, time: np.ndarray) -> tuple[np.ndarray, object]:
        return np.arcsinh(self.k * y) / self.k, state


def test_an_effect_outside_the_package_brings_its_inverse(monkeypatch) -> None:
    model = model_with(OwnSensor(k=0.5))
    assert mismatch(model, Inverse(model)) < 1e-12
    monkeypatch.delattr(OwnSensorBlock, "inverted")
    with pytest.raises(ModelError, match="own_sensor: OwnSensorBlock has no inverse"):
        Inverse(model)


def test_two_forms_of_the_pole_of_the_amplifier_are_refused_and_one_is_inverted() -> None:
    both = AmplifierBandwidth(tau=3e-5), AmplifierBandwidthHeld(tau=3e-5)
    with pytest.raises(ModelError, match="amplifier_bandwidth_held: cannot be inverted together with amplifier_bandwi"):
        Inverse(model_with(*both))
    for k, effect in enumerate(both):
        model = model_with(effect, both[1 - k].off())
        assert mismatch(model, Inverse(model)) < 1e-12, effect.name


def test_several_together_are_exact() -> None:
    added = [typical(k) for k in CHAIN if k in (Creep, HysteresisMemory, Offset)]
    kinds = {
        "amplifier_bandwidth",
        "asymmetric_hysteresis",
        "creep_exponential",
        "sensor_nonlinearity",
        "thermal_drift",
    }
    model = model_with(*added, *(typical(k) for k in CHAIN if k.name in kinds))
    assert mismatch(model, Inverse(model)) < 1e-12


def test_a_falling_curve_is_turned_round_too() -> None:
    model = model_with(BoucWen(A=0.7, p1=0.1, p2=-2.2))
    assert mismatch(model, Inverse(model)) < 1e-12


def test_a_loop_with_rate_is_exact_where_it_is_steep_enough() -> None:
    model = model_with(RateDependentHysteresis(k=-0.02, a=0.1))
    assert mismatch(model, Inverse(model)) < 1e-12


def test_a_loop_with_rate_is_not_exact_at_speeds_at_which_w_would_fall() -> None:
    """At 150/s no step of the drive reaches what is wanted, and the path was missed by 11 times its range."""
    model = model_with(RateDependentHysteresis(k=0.09, a=0.5))
    assert mismatch(model, Inverse(model)) > 1.0
    assert not Inverse(model).is_exact
    assert not Inverse(model, Limits(max_slew_rate=1500.0)).is_exact
    assert Inverse(model, Limits(max_slew_rate=50.0)).is_exact


def test_a_loop_that_follows_the_speed_with_a_lag_is_not_exact() -> None:
    model = model_with(RateDependentHysteresisLagged(k=0.01, a=0.1, tau=2e-4))
    assert mismatch(model, Inverse(model)) > 1e-4
    assert not Inverse(model).is_exact


def test_the_lag_behind_a_largest_slope_is_left_out_and_told() -> None:
    model = model_with(AmplifierSlewLimitHeld(S=1e4))
    inverse = Inverse(model)
    assert not inverse.is_exact
    assert mismatch(model, inverse) > 1e-3
    assert Inverse(model_with(AmplifierSlewLimitHeld())).is_exact
