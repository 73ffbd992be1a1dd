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

"""Another operator in the role of the hysteresis is one class: simulated, identified, diagnosed, reported, inverted."""

import ast
from pathlib import Path

import numpy as np
import pytest

import piezo_hysteresis
from piezo_hysteresis.blocks.block import Block
from piezo_hysteresis.compensation import Inverse
from piezo_hysteresis.effects import (
    CATALOGUE,
    CHAIN,
    Arx,
    BoucWen,
    ChainPosition,
    HysteresisOperator,
    Invertibility,
    Loop,
    Offset,
    PublishedBoucWen,
)
from piezo_hysteresis.effects.hysteresis.hysteresis_memory import HysteresisMemoryBlock
from piezo_hysteresis.effects.hysteresis.operator import outputs
from piezo_hysteresis.errors import IdentificationError, ModelError
from piezo_hysteresis.identification.identify import identify
from piezo_hysteresis.identification.protocol import excitation
from piezo_hysteresis.identification.protocol.drive_limits import DriveLimits
from piezo_hysteresis.identification.start_models import exact
from piezo_hysteresis.inverse_terms import InverseStart, InverseTerms, PlayTerms
from piezo_hysteresis.model.model import Model
from piezo_hysteresis.parameter import Parameter
from piezo_hysteresis.record import Experiment, Record

SOURCE = Path(piezo_hysteresis.__file__).parent
ROOMS = (
    "cli",
    "compensation",
    "discrepancy",
    "export",
    "fleet",
    "identification",
    "model",
    "nodes",
    "online",
    "report",
)
ORDINARY = {"offset"}
OTHER_MEANINGS = {("report/figures/creep.py", "creep")}  # the name of the figure
ABOUT_ONE_OPERATOR = {
    "cli/model/identify.py",  # its option --published means the published operator
    "identification/training/explicit_step.py",  # recognises the step of Eq. (7)
}
LIMITS = DriveLimits(sample_period=2e-4)


class PrandtlIshlinskii(HysteresisOperator):
    """Plays in parallel; the narrowest, of half width 0, is the proportional part."""

    name = "prandtl_ishlinskii"
    equation = "w = Σ_j c_j p_j"
    signature = "nested loops that return to the point where they were left"
    source = "Gu et al. 2016"
    gain_names = ("c",)
    parameters = (
        Parameter("c", "c_j", "1", (1.0,) + (0.0,) * 7, 0.0, 1e3, "weights of the plays", "Gu et al. 2016"),
        Parameter("reach", "r_max", "1", 0.5, 1e-6, 1e3, "half width of the widest play", "Gu et al. 2016", fixed=True),
    )

    def shaped(self, low, high):
        return self.with_values(reach=0.47 * (high - low))

    @property
    def turning_slope(self):
        return float(self.array("c")[0])

    def block(self, setting, terms=()):
        c = self.array("c")
        names = tuple(f"{self.name}.c[{j}]" for j in range(c.size))
        return HysteresisMemoryBlock(names, c, self["reach"] * np.arange(c.size) / c.size, 0.0)


class OwnPlays(PrandtlIshlinskii):
    """The same operator with a block of its own, which states what the inverse needs."""

    name = "own_plays"
    invertibility = Invertibility.EXACT

    def block(self, setting, terms=()):
        return OwnPlaysBlock(self.array("c"), self["reach"] * np.arange(self.array("c").size) / 8.0)


class OwnPlaysBlock(Block):
    """Plays in plain Python; state p (s,)."""

    def __init__(self, c, radii):
        self.c, self.radii = c, radii

    def static(self, x0):
        return float(self.c.sum() * x0)

    def static_slopes(self, x0):
        return float(self.c.sum()), np.zeros(0)

    def rest(self, x0, time):
        return np.full(self.c.size, x0)

    def run(self, x, state):
        y = np.empty_like(x)
        for i, v in enumerate(x):
            state = np.clip(state, v - self.radii, v + self.radii)
            y[i] = self.c @ state
        return y, state

    def rest_tangent(self, x0, dx0):
        raise NotImplementedError

    def linearise(self, x, dx, state, tangent):
        raise NotImplementedError

    def inverse_terms(self):
        return InverseTerms(plays=PlayTerms(self.c, self.radii))

    def inverse_start(self, x, state):
        return InverseStart(plays=state)


TRUTH = PrandtlIshlinskii(c=(1.1, 0.3, 0.25, 0.2, 0.15, 0.1, 0.05, 0.05), reach=0.47)


@pytest.fixture(scope="module")
def experiment():
    model = Model((TRUTH, Arx(a=(-0.6,), b=(0.4,), delay=2.0), Offset()), 2e-4, 10.0, 1e-5)
    rng = np.random.default_rng(1)
    records = []
    loops = excitation.triangle(LIMITS, (1.0, 0.7, 0.4), 1.0)
    noise = excitation.noise(LIMITS, 1.0, 200.0, 2.0, 0.5, 1)
    for name, u in (("triangle", loops), ("noise", noise), ("validation", 0.8 * loops)):
        record = Record(u, u, 2e-4, name)
        y = model.simulate(record)[0] + 1e-10 * rng.standard_normal(u.size)
        records.append(Record(u, y, 2e-4, name))
    return Experiment(tuple(records))


def test_its_start_comes_from_its_own_loops():
    v = np.concatenate([excitation.triangle(DriveLimits(sample_period=1e-3), (1.0, 0.6, 0.3), 1.0)]) / 10.0
    (w,) = _outputs(TRUTH, v)
    found = PrandtlIshlinskii().started([Loop(v, w + 0.2)])
    assert np.std(_outputs(found, v)[0] - w) < 0.02 * np.ptp(w)
    with pytest.raises(IdentificationError, match="triangle"):
        PrandtlIshlinskii().started([Loop(np.ones(9), np.ones(9), start=1.0)])


def test_it_is_identified_by_its_class_alone(experiment):
    found = identify(experiment, hysteresis=PrandtlIshlinskii, orders=(1, 1))
    assert isinstance(found.model.hysteresis, PrandtlIshlinskii)
    assert found.free_run_percent < 0.3
    assert found.free_run_percent < 0.5 * identify(experiment, orders=(1, 1)).free_run_percent
    assert found.model[Arx.name].dc_gain == pytest.approx(1.0, rel=1e-6)  # the gauge is held for its gains too


def test_its_block_defines_its_inverse():
    model = Model((OwnPlays(**TRUTH.values), Arx(a=(-0.6,), b=(0.4,), delay=2.0), Offset()), 2e-4, 10.0, 1e-5)
    inverse = Inverse(model)
    moved = 4.0 * np.sin(np.linspace(0.0, 9.0, 300))
    _, state = model.run(np.append(moved, np.full(100, moved[-1])), model.rest(0.0))  # until the dynamics have settled
    later, _ = model.run(moved[::-1], state)
    u, _ = inverse.command(later, inverse.resume(state))
    reached, _ = model.run(u, state)
    assert np.abs(reached[inverse.preview :] - later).max() < 1e-12 * np.abs(later).max()


def test_an_operator_without_inverse_is_refused_by_name():
    class Silent(OwnPlays):
        """Names no form of its inverse."""

        def block(self, setting, terms=()):
            block = super().block(setting, terms)
            block.inverse_terms = lambda: None
            return block

    with pytest.raises(ModelError, match="own_plays: OwnPlaysBlock has no inverse"):
        Inverse(Model((Silent(**TRUTH.values), Arx(b=(1.0,))), 2e-4, 10.0, 1e-5))


def test_no_operator_is_an_effect_to_be_added():
    assert not [e.name for e in CATALOGUE if issubclass(e, HysteresisOperator)]


def test_a_chain_without_a_hysteresis_is_refused():
    bare = Model((Arx(b=(1.0,)),), 2e-4)
    assert not bare.has_hysteresis
    with pytest.raises(ModelError, match="expected one"):
        _ = bare.hysteresis


def test_the_exact_operator_takes_the_place_of_the_published_one():
    published = Model((PublishedBoucWen(A=-0.5), Arx(b=(1.0,))), 2e-4)
    assert exact(published).hysteresis == BoucWen(A=-0.5)
    with pytest.raises(ModelError, match="expected 1"):
        exact(published.with_hysteresis(PublishedBoucWen(n=2.0)))


@pytest.mark.parametrize("operator", [BoucWen(), PublishedBoucWen(), TRUTH], ids=lambda o: o.name)
def test_the_output_is_proportional_to_the_gains(operator):
    v = 0.8 * np.sin(np.linspace(0.0, 12.0, 500))
    (once,), (twice,) = _outputs(operator, v), _outputs(operator.scaled(2.0), v)
    assert np.allclose(twice, 2.0 * once, rtol=1e-12)
    small = np.array([0.0, 1e-6])
    (w,) = _outputs(operator, small)
    assert (w[1] - w[0]) / 1e-6 == pytest.approx(operator.turning_slope, rel=1e-4)


def test_no_room_above_the_catalogue_names_an_effect_in_a_string():
    """Who asks for a role or a class is not touched by another effect; a name in a string would be."""
    names = {effect.name for effect in CHAIN}
    found = []
    for path in (p for room in ROOMS for p in (SOURCE / room).rglob("*.py")):
        tree, where = ast.parse(path.read_text(encoding="utf-8")), str(path.relative_to(SOURCE))
        prose = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
        for node in ast.walk(tree):
            if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in prose:
                word = node.value.partition(".")[0]
                if word in names and node.value not in ORDINARY and (where, node.value) not in OTHER_MEANINGS:
                    found.append(f"{where}:{node.lineno}: '{node.value}'")
    assert not found, "\n".join(found)


def test_no_room_above_the_catalogue_names_a_class_of_the_hysteresis():
    """Operators, their terms and the memory are reached through `Model.hysteresis`, `HYSTERESIS` and `MEMORY`."""
    members = {e.__name__ for e in CHAIN if e.family == "hysteresis" and e.place is ChainPosition.HYSTERESIS}
    found = []
    for path in (p for room in ROOMS for p in (SOURCE / room).rglob("*.py")):
        where = str(path.relative_to(SOURCE))
        if where in ABOUT_ONE_OPERATOR:
            continue
        named = {
            alias.name
            for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
            if isinstance(node, ast.ImportFrom)
            for alias in node.names
        }
        found += [f"{where}: {name}" for name in sorted(named & members)]
    assert "HysteresisMemory" in members
    assert not found, "\n".join(found)


def _outputs(operator, v):
    return outputs(operator, [Loop(v, v, start=float(v[0]))])
