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

"""Plays whose weights depend on the level: a term of the plays."""

from __future__ import annotations

from typing import Self

import numpy as np

from ...blocks.block import Array, Block, State
from ...blocks.kernel import kernel
from ...c_form import CForm, Number
from ...inverse_terms import InverseStart, InverseTerms, PlayTerms
from ...parameter import Parameter
from ..effect import ChainPosition, Effect, Term
from ..extent import Extent
from ..invertibility import Invertibility
from .level_density import VALUE_IN_C, level_density, level_slopes, level_value
from .play import play_positions, play_slopes


def _relative(name: str, symbol: str, meaning: str, power: int) -> Parameter:
    return Parameter(name, symbol, "1", 0.0, -2.0, 2.0, meaning, "Preisach", 0.0, 0.1, powers=(power, 0))


class LevelDependentMemory(Term):
    """The weight of each play depends on the position of the play.

    Parameters
    ----------
    slope_narrow, slope_wide : float
        k_j of the narrowest and of the widest play [1]; interpolated linearly in the number of the play.
    curvature : float
        q of all plays [1].
    middle : float
        Position m at which the weights are c_j [normalised, 1].

    Notes
    -----
    A Preisach operator can be written as a sum of plays, with one monotone function f_j for every play; its derivative
    is the Preisach density along the level. Here the density is c_j (1 + k_j (p − m) + q (p − m)²)².
    """

    name = "level_dependent_memory"
    family = "hysteresis"
    place = ChainPosition.HYSTERESIS
    host = "hysteresis_memory"
    invertibility = Invertibility.EXACT
    equation = "Σ_j c_j ∫_0^p_j (1 + k_j (s − m) + q (s − m)²)² ds,  k_j from k_1 to k_n"
    signature = "Loops of one amplitude are wider at one level of the range than at another"
    source = "Preisach operator, written with one function for each play"
    parameters = (
        _relative("slope_narrow", "k_1", "slope along the level, narrowest play", -1),
        _relative("slope_wide", "k_n", "slope along the level, widest play", -1),
        _relative("curvature", "q", "curvature along the level", -2),
        Parameter(
            "middle", "m", "1", 0.0, -10.0, 10.0, "level of the weights c_j", "Preisach", fixed=True, powers=(1, 0)
        ),
    )

    @classmethod
    def starts(cls, extent: Extent) -> tuple[Self, ...]:
        return (cls(middle=0.5 * (extent.voltage_min + extent.voltage_max) / extent.voltage_scale),)


@kernel
def run_level_plays(v, c, a, b, q, radii, plays, y):
    """Output y (n,) = Σ c_j f_j(p_j); plays (s,) is updated."""
    parts = np.empty(radii.size)
    for i in range(v.size):
        for j in range(radii.size):  # without the sum, several plays are computed at a time
            plays[j] = max(v[i] - radii[j], min(v[i] + radii[j], plays[j]))
            parts[j] = c[j] * level_value(plays[j], a[j], b[j], q)
        y[i] = 0.0
        for j in range(radii.size):
            y[i] += parts[j]


@kernel
def linearise_level_plays(v, dv, c, a, b, q, m, radii, plays, dplays, y, dy, own):
    """`run_level_plays` and derivatives: dv (m, n) to dy (m, n); own (s + 3, n) by c_j, k_1, k_n and q."""
    s, p, dp = radii.size, np.empty(v.size), np.empty(v.size)
    y[:] = 0.0
    dy[:] = 0.0
    own[s:] = 0.0
    by_narrow, by_wide, by_curvature = own[s], own[s + 1], own[s + 2]
    for j in range(s):  # play after play, because these loops without memory are computed several samples at a time
        before = plays[j]
        plays[j] = play_positions(v, radii[j], before, p)
        for r in range(dv.shape[0]):
            dplays[r, j] = play_slopes(v, dv[r], radii[j], before, p, dplays[r, j], dp)
            for i in range(v.size):
                dy[r, i] += c[j] * level_density(p[i], a[j], b[j], q) * dp[i]
        value, wide = own[j], j / (s - 1.0)
        for i in range(v.size):
            value[i] = level_value(p[i], a[j], b[j], q)
            y[i] += c[j] * value[i]
        for i in range(v.size):
            by_k, by_q = level_slopes(p[i], a[j], b[j], q, m)
            by_narrow[i] += (1.0 - wide) * c[j] * by_k
            by_wide[i] += wide * c[j] * by_k
            by_curvature[i] += c[j] * by_q


REST = """\
double total = 0.0;
int j;
for (j = 0; j < PLAYS; j++) {
    const double p = s->p[j] = x - virgin * smaller(larger(x - earlier[j], -radius[j]), radius[j]);
    total += c[j] * VALUE;
}
return total;
"""
"""C code of plays at rest; VALUE is the function of each play."""
STEP = """\
double total = 0.0;
int j;
for (j = 0; j < PLAYS; j++) {
    const double p = s->p[j] = larger(x - radius[j], smaller(x + radius[j], s->p[j]));
    total += c[j] * VALUE;
}
return total;
"""
"""C code of plays for one sample."""


class PlaysBlock(Block):
    """A sum over plays p_j of one input; state p (s,).

    Parameters
    ----------
    names : tuple of str
        Names of the numbers, those of the weights first.
    c, radii : (s,) ndarray
        Weights and half widths of the plays.
    virgin : float
        State at rest: 0 for centred plays, 1 for the state after the drive before the rest.
    before : (s,) ndarray or None
        Plays before the drive came to the rest; None for plays at 0.
    """

    keeps_state = True

    def __init__(
        self, names: tuple[str, ...], c: Array, radii: Array, virgin: float, before: Array | None = None
    ) -> None:
        self.names, self.c, self.radii, self.virgin = names, c, radii, virgin
        self.before = np.zeros_like(radii) if before is None else before

    def rest(self, x0: float, time: float) -> State:
        return x0 - self.virgin * np.clip(x0 - self.before, -self.radii, self.radii)

    def _rest_slopes(self, x0: float) -> Array:
        return np.asarray(1.0 - self.virgin * (abs(x0 - self.before) < self.radii))

    def rest_tangent(self, x0: float, dx0: Array) -> State:
        return np.outer(dx0, self._rest_slopes(x0))

    def inverse_start(self, x: float, state: State) -> InverseStart:
        return InverseStart(plays=state)

    def plays_in_c(self, value: str, library: str = "", **numbers: Number) -> CForm:
        """C code of Σ c_j value(p_j), from a C expression in p."""
        constants: dict[str, Number] = {"PLAYS": self.c.size, "c": self.c, "radius": self.radii, **numbers}
        constants |= {"virgin": self.virgin, "earlier": self.before}
        step, rest = (code.replace("VALUE", value) for code in (STEP, REST))
        return CForm(step, rest, constants, (f"double p[{self.c.size}]",), (library,) if library else ())


class LevelDependentMemoryBlock(PlaysBlock):
    """Σ c_j f_j(p_j); state p (s,).

    Parameters
    ----------
    names, c, radii, virgin, before
        As for `PlaysBlock`; the names of k_1, k_n and q follow those of the weights.
    term : LevelDependentMemory
        The dependence on the level.
    """

    def __init__(
        self, names: tuple[str, ...], c: Array, radii: Array, virgin: float, before: Array, term: Effect
    ) -> None:
        super().__init__(names, c, radii, virgin, before)
        self.middle, self.q = term["middle"], term["curvature"]
        k = np.linspace(term["slope_narrow"], term["slope_wide"], c.size)
        self.a, self.b = 1.0 - self.middle * (k - self.q * self.middle), k - 2.0 * self.q * self.middle

    def static(self, x0: float) -> float:
        return float(self.c @ level_value(self.rest(x0, 0.0), self.a, self.b, self.q))

    def static_slopes(self, x0: float) -> tuple[float, Array]:
        p, wide = self.rest(x0, 0.0), np.linspace(0.0, 1.0, self.c.size)
        by_k, by_q = level_slopes(p, self.a, self.b, self.q, self.middle)
        own = np.array([(1.0 - wide) * by_k, wide * by_k, by_q]) @ self.c
        slope = self.c @ (level_density(p, self.a, self.b, self.q) * self._rest_slopes(x0))
        return float(slope), np.concatenate((level_value(p, self.a, self.b, self.q), own))

    def run(self, x: Array, state: State) -> tuple[Array, State]:
        y, state = np.empty_like(x), state.copy()
        run_level_plays(x, self.c, self.a, self.b, self.q, self.radii, state, y)
        return y, state

    def linearise(self, x: Array, dx: Array, state: State, tangent: State) -> tuple[Array, Array, State, State]:
        y, state, tangent = np.empty_like(x), state.copy(), tangent.copy()
        rows = np.empty((len(dx) + len(self.names), x.size))
        mapped, own = rows[: len(dx)], rows[len(dx) :]
        numbers = self.c, self.a, self.b, self.q, self.middle, self.radii
        linearise_level_plays(x, np.ascontiguousarray(dx), *numbers, state, tangent, y, mapped, own)
        return y, rows, state, tangent

    def c_form(self) -> CForm:
        return self.plays_in_c("level_value(p, a[j], b[j], q)", VALUE_IN_C, a=self.a, b=self.b, q=self.q)

    def inverse_terms(self) -> InverseTerms:
        root = np.vstack((self.a, self.b, np.full(self.a.size, self.q)))
        return InverseTerms(plays=PlayTerms(self.c, self.radii, self.virgin, self.before, root))
