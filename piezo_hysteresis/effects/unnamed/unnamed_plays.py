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

"""A correction without a name that depends on the last turning points of the stage."""

from __future__ import annotations

import numpy as np

from ...blocks.block import Array, Block, State
from ...c_form import CForm
from ...parameter import Parameter
from ..effect import Discretisation, Effect
from ..hysteresis.hysteresis_memory import HysteresisMemoryBlock
from ..invertibility import Invertibility
from .unnamed_correction import CorrectionShape, UnnamedCorrection

SPAN = 64.0
"""Ratio of the largest to the smallest half width."""


class UnnamedPlays(UnnamedCorrection):
    """A small part of the motion that lags in position, similar to friction of a guide, without a physical name.

    Parameters
    ----------
    c : sequence of float
        Weights of the plays, from the narrowest to the widest, at least 1 [1]; they are not negative, because a stage
        is passive.
    reach : float
        Half width of the widest play [normalised, 1].

    Notes
    -----
    The half widths are a geometric grid from ``reach``/64 to ``reach``; a single play has ``reach``/64.
    """

    name = "unnamed_plays"
    invertibility = Invertibility.IMPOSSIBLE
    equation = "y = x + Σ_j c_j p_j,  p_j = max(x − r_j, min(x + r_j, p_j before))"
    signature = "The residual depends on the distance from the last turning points, in the same way at every rate"
    source = "Prandtl-Ishlinskii operator on the position"
    depends_on = "distance from the last turning points"
    parameters = (
        Parameter("c", "c_j", "1", (0.0,) * 7, 0.0, 0.2, "weights of the plays", "fit", 0.0, 0.01),
        Parameter(
            "reach",
            "r_max",
            "1",
            0.5,
            1e-6,
            10.0,
            "half width of the widest play",
            "records",
            fixed=True,
            powers=(0, 1),
        ),
    )

    @property
    def radii(self) -> Array:
        """Half widths of the plays [normalised], shape (any,)."""
        return self["reach"] * SPAN ** np.linspace(-1.0, 0.0, self.array("c").size)

    def shape(self, displacement_scale: float) -> CorrectionShape:
        return CorrectionShape(
            "half width of the play", "m", displacement_scale * self.radii, "weight", "1", self.array("c")
        )

    def block(self, setting: Discretisation, terms: tuple[Effect, ...] = ()) -> Block:
        names = tuple(f"unnamed_plays.c[{j}]" for j in range(self.array("c").size))
        return UnnamedPlaysBlock(names, self.array("c"), self.radii, 0.0)


class UnnamedPlaysBlock(HysteresisMemoryBlock):
    """x + Σ c_j play(x, r_j); state p (s,)."""

    def static(self, x0: float) -> float:
        return x0 + super().static(x0)

    def static_slopes(self, x0: float) -> tuple[float, Array]:
        slope, own = super().static_slopes(x0)
        return 1.0 + slope, own

    def run(self, x: Array, state: State) -> tuple[Array, State]:
        added, state = super().run(x, state)
        return x + added, state

    def linearise(self, x: Array, dx: Array, state: State, tangent: State) -> tuple[Array, Array, State, State]:
        added, rows, state, tangent = super().linearise(x, dx, state, tangent)
        rows[: len(dx)] += dx
        return x + added, rows, state, tangent

    def c_form(self) -> CForm:
        step, rest = (f"return x + ME_plays_{name}(&s->plays, x);" for name in ("step", "rest"))
        return CForm(step, rest, parts={"plays": super().c_form()})
