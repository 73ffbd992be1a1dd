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

"""Memory of turning points: play operators in addition to the Bouc-Wen state, which has no such memory."""

from __future__ import annotations

from typing import ClassVar, Self

import numpy as np

from ...blocks.block import Array, Block, State
from ...blocks.kernel import kernel
from ...c_form import CForm
from ...errors import ParameterError
from ...inverse_terms import InverseTerms, PlayTerms
from ...parameter import Parameter
from ..effect import ChainPosition, Discretisation, Effect, Term
from ..excitation_need import ExcitationNeed
from ..extent import Extent
from ..invertibility import Invertibility
from .level_dependent_memory import LevelDependentMemory, LevelDependentMemoryBlock, PlaysBlock
from .play import play_positions, play_slopes

SPAN = 32.0
"""Ratio of the largest to the smallest half width."""


class HysteresisMemory(Effect):
    """Play operators of several half widths are added to the hysteresis output (Prandtl-Ishlinskii operator).

    Parameters
    ----------
    c : sequence of float
        Weights of the plays, from the narrowest to the widest, at least 2 [1]; they are not negative, because an
        actuator is passive.
    reach : float
        Half width of the widest play [normalised, 1]; all plays move if it is below half the drive range.
    virgin : float
        State at rest [1]: at 0 every play is centred, at 1 every play is in the state after a ramp from 0 V.
    turns : sequence of float
        Turning points of the drive [normalised, 1] on its way from 0 V to the rest, if the ramp was not direct.

    Notes
    -----
    The half widths are a geometric grid from ``reach``/32 to ``reach``.
    """

    name = "hysteresis_memory"
    invertibility = Invertibility.EXACT
    family = "hysteresis"
    place = ChainPosition.HYSTERESIS
    excitation_need = ExcitationNeed.SEVERAL_AMPLITUDES
    equation = "w + Σ_j c_j p_j,  p_j = max(v − r_j, min(v + r_j, p_j before))"
    signature = (
        "The residual is large in nested and decaying minor loops, where the stage returns to the point at "
        "which it left a loop"
    )
    source = "Prandtl-Ishlinskii operator; Gu et al. 2016"
    loop_names = ("c",)
    level_term: ClassVar[type[Term]] = LevelDependentMemory
    """Term that makes the weights of the plays depend on the level."""
    parameters = (
        Parameter(
            "c", "c_j", "1", (0.0,) * 8, 0.0, 10.0, "weights of the plays", "Gu et al. 2016", 0.0, 0.05, powers=(-1, 1)
        ),
        Parameter(
            "reach",
            "r_max",
            "1",
            0.5,
            1e-3,
            10.0,
            "half width of the widest play",
            "Gu 2016",
            fixed=True,
            powers=(1, 0),
        ),
        Parameter(
            "virgin", "f_0", "1", 0.0, 0.0, 1.0, "state at rest: 0 relaxed, 1 reached from 0 V", "Gu 2016", fixed=True
        ),
        Parameter(
            "turns",
            "v_t",
            "1",
            (),
            -10.0,
            10.0,
            "turning points of the drive before the rest",
            "Gu 2016",
            fixed=True,
            powers=(1, 0),
        ),
    )

    @classmethod
    def starts(cls, extent: Extent) -> tuple[Self, ...]:
        half = extent.span / (2.0 * extent.voltage_scale)
        low, high = extent.voltage_min / extent.voltage_scale, extent.voltage_max / extent.voltage_scale
        at_rest = cls(reach=max(half, abs(low), abs(high)), virgin=1.0)
        return cls(reach=half), at_rest, at_rest.with_values(turns=(high, low))

    def refined(self) -> Self:
        """The same effect with an additional play of zero weight between every two plays."""
        c = self.array("c")
        finer = np.zeros(2 * c.size - 1)
        finer[::2] = c
        return self.with_values(c=tuple(finer.tolist()))

    def check(self) -> None:
        if self.array("c").size < 2:
            raise ParameterError(f"hysteresis_memory.c: got {self.array('c').size} plays, expected at least 2")

    @property
    def radii(self) -> Array:
        """Half widths of the plays [normalised], shape (any,)."""
        return self["reach"] * SPAN ** np.linspace(-1.0, 0.0, self.array("c").size)

    @property
    def before(self) -> Array:
        """Plays [normalised] at the last of `turns`, and 0 without turning points, shape (any,)."""
        plays = np.zeros_like(self.radii)
        for turn in self.array("turns"):
            plays = np.clip(plays, turn - self.radii, turn + self.radii)
        return plays

    def block(self, setting: Discretisation, terms: tuple[Effect, ...] = ()) -> Block:
        plays = self.array("c"), self.radii, self["virgin"], self.before
        names = tuple(f"hysteresis_memory.c[{j}]" for j in range(self.array("c").size))
        if terms:
            names += tuple(f"{terms[0].name}.{p.name}" for p in terms[0].parameters if not p.fixed)
            return LevelDependentMemoryBlock(names, *plays, terms[0])
        return HysteresisMemoryBlock(names, *plays)


@kernel
def run_plays(v, c, radii, plays, y):
    """Output y (n,) = Σ c_j p_j; plays (s,) is updated."""
    for i in range(v.size):
        total = 0.0
        for j in range(radii.size):
            plays[j] = max(v[i] - radii[j], min(v[i] + radii[j], plays[j]))
            total += c[j] * plays[j]
        y[i] = total


@kernel
def linearise_plays(v, dv, c, radii, plays, dplays, y, dy, own):
    """`run_plays` and derivatives dy (m, n) from dv (m, n); own (s, n) = p_j; plays (s,), dplays (m, s) are updated."""
    dp = np.empty(v.size)
    y[:] = 0.0
    dy[:] = 0.0
    for j in range(radii.size):
        p, before = own[j], plays[j]
        plays[j] = play_positions(v, radii[j], before, p)
        for i in range(v.size):
            y[i] += c[j] * p[i]
        for r in range(dv.shape[0]):
            dplays[r, j] = play_slopes(v, dv[r], radii[j], before, p, dplays[r, j], dp)
            for i in range(v.size):
                dy[r, i] += c[j] * dp[i]


class HysteresisMemoryBlock(PlaysBlock):
    """Σ c_j play(v, r_j); state p (s,)."""

    def static(self, x0: float) -> float:
        return float(self.c @ self.rest(x0, 0.0))

    def static_slopes(self, x0: float) -> tuple[float, Array]:
        return float(self.c @ self._rest_slopes(x0)), self.rest(x0, 0.0)

    def run(self, x: Array, state: State) -> tuple[Array, State]:
        y, state = np.empty_like(x), state.copy()
        run_plays(x, self.c, self.radii, state, y)
        return y, state

    def linearise(self, x: Array, dx: Array, state: State, tangent: State) -> tuple[Array, Array, State, State]:
        y, state, tangent = np.empty_like(x), state.copy(), tangent.copy()
        rows = np.empty((len(dx) + self.c.size, x.size))
        mapped, own = rows[: len(dx)], rows[len(dx) :]
        if not self.c.any():  # plays without weight have no output
            linearise_plays(x, dx[:0].copy(), self.c, self.radii, state, tangent[:0].copy(), y, mapped[:0], own)
            mapped[:] = 0.0
        else:
            linearise_plays(x, np.ascontiguousarray(dx), self.c, self.radii, state, tangent, y, mapped, own)
        return y, rows, state, tangent

    def c_form(self) -> CForm:
        return self.plays_in_c("p")

    def inverse_terms(self) -> InverseTerms:
        return InverseTerms(plays=PlayTerms(self.c, self.radii, self.virgin, self.before))
