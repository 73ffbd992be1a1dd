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

import numpy as np

from ...blocks.block import Array, Block, State
from ...blocks.kernel import kernel
from ...c_form import CForm, Number
from ...inverse_terms import InverseStart, InverseTerms, PlayTerms
from ...parameter import Parameter
from ..effect import ChainPosition, Term
from ..invertibility import Invertibility


class LevelDependentMemory(Term):
    """The weight of each play grows or shrinks with the position of the play.

    Parameters
    ----------
    k_narrow, k_wide : float
        Relative growth per unit of level of the narrowest and of the widest play [1]; interpolated linearly in the
        number of the play.

    Notes
    -----
    A Preisach operator can be written as a sum of plays, with one monotone function f_j for every play. This effect is
    the quadratic term of f_j. Up to |k| = 0.5 and |p| = 1 every f_j is monotone, so that the operator can be inverted.
    """

    name = "level_dependent_memory"
    family = "hysteresis"
    place = ChainPosition.HYSTERESIS
    host = "hysteresis_memory"
    invertibility = Invertibility.EXACT
    equation = "Σ_j c_j (p_j + k_j p_j²),  k_j from k_narrow to k_wide"
    signature = "Loops of one amplitude are wider at one end of the range than at the other"
    source = "quadratic term of a Preisach operator, written with one function for each play"
    parameters = (
        Parameter(
            "k_narrow", "k_1", "1", 0.0, -0.5, 0.5, "growth of the narrowest play", "Preisach", 0.0, 0.1, powers=(-1, 0)
        ),
        Parameter(
            "k_wide", "k_n", "1", 0.0, -0.5, 0.5, "growth of the widest play", "Preisach", 0.0, 0.1, powers=(-1, 0)
        ),
    )


@kernel
def run_level_plays(v, c, bends, radii, plays, y):
    """Output y (n,) = Σ c_j (p_j + b_j p_j²); plays (s,) is updated."""
    for i in range(v.size):
        total = 0.0
        for j in range(radii.size):
            p = max(v[i] - radii[j], min(v[i] + radii[j], plays[j]))
            plays[j] = p
            total += c[j] * (p + bends[j] * p * p)
        y[i] = total


@kernel
def linearise_level_plays(v, dv, c, bends, by_bend, radii, plays, dplays, y, dy, own):
    """`run_level_plays` and derivatives: dv (m, n) to dy (m, n); own (s + k, n) by c_j and by the k numbers of b_j."""
    s = radii.size
    for i in range(v.size):
        total = 0.0
        for k in range(by_bend.shape[0]):
            own[s + k, i] = 0.0
        for r in range(dv.shape[0]):
            dy[r, i] = 0.0
        for j in range(s):
            held, low, high = plays[j], v[i] - radii[j], v[i] + radii[j]
            p = max(low, min(high, held))
            plays[j] = p
            if held <= low:
                for r in range(dv.shape[0]):
                    dplays[r, j] = dv[r, i] if held < low else max(dplays[r, j], dv[r, i])
            elif held >= high:
                for r in range(dv.shape[0]):
                    dplays[r, j] = dv[r, i] if held > high else min(dplays[r, j], dv[r, i])
            own[j, i] = p + bends[j] * p * p
            total += c[j] * own[j, i]
            for k in range(by_bend.shape[0]):
                own[s + k, i] += c[j] * by_bend[k, j] * p * p
            for r in range(dv.shape[0]):
                dy[r, i] += c[j] * (1.0 + 2.0 * bends[j] * p) * dplays[r, j]
        y[i] = total


REST = """\
double total = 0.0;
int j;
for (j = 0; j < PLAYS; j++) {
    const double p = s->p[j] = x - virgin * smaller(larger(x, -radius[j]), radius[j]);
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


def plays_in_c(value: str, c: Array, radii: Array, virgin: float, **numbers: Array) -> CForm:
    """C code of Σ c_j value(p_j), from a C expression in p."""
    constants: dict[str, Number] = {"PLAYS": c.size, "c": c, "radius": radii, "virgin": virgin, **numbers}
    step, rest = (code.replace("VALUE", value) for code in (STEP, REST))
    return CForm(step, rest, constants, (f"double p[{c.size}]",))


class PlaysBlock(Block):
    """A sum over plays p_j of one input; state p (s,).

    Parameters
    ----------
    names : tuple of str
        Names of the numbers, those of the weights first.
    c, radii : (s,) ndarray
        Weights and half widths of the plays.
    virgin : float
        State at rest: 0 for centred plays, 1 for the state after a ramp from 0 V.
    """

    keeps_state = True

    def __init__(self, names: tuple[str, ...], c: Array, radii: Array, virgin: float) -> None:
        self.names, self.c, self.radii, self.virgin = names, c, radii, virgin

    def rest(self, x0: float, time: float) -> State:
        return x0 - self.virgin * np.clip(x0, -self.radii, self.radii)

    def _rest_slopes(self, x0: float) -> Array:
        return np.asarray(1.0 - self.virgin * (abs(x0) < self.radii))

    def rest_tangent(self, x0: float, dx0: Array) -> State:
        return np.outer(dx0, self._rest_slopes(x0))

    def inverse_start(self, x: float, state: State) -> InverseStart:
        return InverseStart(plays=state)


class LevelDependentMemoryBlock(PlaysBlock):
    """Σ c_j (p_j + b_j p_j²), b = numbers @ by_bend; state p (s,).

    Parameters
    ----------
    names, c, radii, virgin
        As for `PlaysBlock`; the names of the k numbers follow those of the weights.
    numbers : (k,) ndarray
        Numbers of the bends.
    by_bend : (k, s) ndarray
        Share of each number in the bend of each play.
    """

    def __init__(
        self, names: tuple[str, ...], c: Array, radii: Array, virgin: float, numbers: Array, by_bend: Array
    ) -> None:
        super().__init__(names, c, radii, virgin)
        self.by_bend, self.bends = by_bend, numbers @ by_bend

    def static(self, x0: float) -> float:
        p = self.rest(x0, 0.0)
        return float(self.c @ (p + self.bends * p * p))

    def static_slopes(self, x0: float) -> tuple[float, Array]:
        p = self.rest(x0, 0.0)
        slope = float(self.c @ ((1.0 + 2.0 * self.bends * p) * self._rest_slopes(x0)))
        return slope, np.concatenate((p + self.bends * p * p, self.by_bend @ (self.c * p * p)))

    def run(self, x: Array, state: State) -> tuple[Array, State]:
        y, state = np.empty_like(x), state.copy()
        run_level_plays(x, self.c, self.bends, self.radii, state, y)
        return y, state

    def linearise(self, x: Array, dx: Array, state: State, tangent: State) -> tuple[Array, Array, State, State]:
        y, state, tangent = np.empty_like(x), state.copy(), tangent.copy()
        rows = np.empty((len(dx) + len(self.names), x.size))
        mapped, own = rows[: len(dx)], rows[len(dx) :]
        incoming = np.ascontiguousarray(dx)
        linearise_level_plays(x, incoming, self.c, self.bends, self.by_bend, self.radii, state, tangent, y, mapped, own)
        return y, rows, state, tangent

    def c_form(self) -> CForm:
        return plays_in_c("(p + bend[j] * p * p)", self.c, self.radii, self.virgin, bend=self.bends)

    def inverse_terms(self) -> InverseTerms:
        return InverseTerms(plays=PlayTerms(self.c, self.bends, self.radii, self.virgin))
