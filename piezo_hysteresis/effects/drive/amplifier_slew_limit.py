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

"""Largest current of the amplifier into the capacitance of the actuator."""

from __future__ import annotations

from typing import Self

import numpy as np

from ...blocks.block import Array, Block, State
from ...blocks.held import HeldBlock
from ...blocks.kernel import kernel
from ...c_form import CForm
from ...inverse_terms import InverseStart, InverseTerms
from ..effect import ChainPosition, Discretisation, Effect
from ..extent import Extent
from ..invertibility import Invertibility
from .amplifier_slew_limit_settling import SLOPE, UNLIMITED, AmplifierSlewLimitSettling

FINER_TAU = 1e-5
"""Time constant with which the search for a settling amplifier starts [s]."""


class AmplifierSlewLimit(Effect):
    """The drive voltage cannot change faster than the amplifier can charge the actuator.

    Parameters
    ----------
    S : float
        Largest slope I_max/(C·gain), as drive voltage before the amplifier [V/s]; 1e9 means no limit.
    """

    name = "amplifier_slew_limit"
    invertibility = Invertibility.EXACT
    family = "amplifier"
    place = ChainPosition.DRIVE
    equation = "|dy/dt| ≤ S = I_max/(C·gain)"
    signature = "Fast signals of large amplitude become triangles"
    source = "0.5 A into 20 µF: 25 V/ms after the amplifier"
    parameters = (SLOPE,)

    @classmethod
    def starts(cls, extent: Extent) -> tuple[Self, ...]:
        slopes = extent.max_slew / 2.0 ** np.arange(1.0, 12.0, 0.5)  # noise gives many local minima
        return tuple(cls(S=float(slope)) for slope in slopes if slope > extent.span)

    def refined(self) -> AmplifierSlewLimitSettling:
        """The limit of an amplifier with a small time constant; it needs one, as that of 0 has no influence."""
        return AmplifierSlewLimitSettling(S=self["S"], tau=FINER_TAU)

    def block(self, setting: Discretisation, terms: tuple[Effect, ...] = ()) -> Block:
        return AmplifierSlewLimitBlock(self["S"], setting.sample_period)


@kernel
def run_limit(x, reach, state, y):
    """Follow x (n,) in steps of at most `reach` per sample; writes y (n,) and updates state [y]."""
    held = state[0]
    for i in range(x.size):
        if x[i] > held + reach:
            held += reach
        elif x[i] < held - reach:
            held -= reach
        else:
            held = x[i]
        y[i] = held
    state[0] = held


@kernel
def linearise_limit(x, dx, reach, period, state, tangent, y, dy):
    """`run_limit` and its derivatives: dx (m, n) to dy (m + 1, n), the last row by S; tangent (m + 1,) is updated."""
    m, held = dx.shape[0], state[0]
    for i in range(x.size):
        if x[i] > held + reach:
            held += reach
            tangent[m] += period
        elif x[i] < held - reach:
            held -= reach
            tangent[m] -= period
        else:
            held = x[i]
            for j in range(m):
                tangent[j] = dx[j, i]
            tangent[m] = 0.0
        y[i] = held
        for j in range(m + 1):
            dy[j, i] = tangent[j]
    state[0] = held


class AmplifierSlewLimitBlock(HeldBlock):
    """y_i = max(y_(i−1) − S T, min(y_(i−1) + S T, x_i))."""

    names = ("amplifier_slew_limit.S",)

    def __init__(self, slope: float, sample_period: float) -> None:
        self.reach = slope * sample_period if slope < UNLIMITED else np.inf
        self.sample_period = sample_period

    def follow(self, x: Array, state: State, y: Array) -> None:
        run_limit(x, self.reach, state, y)

    def follow_tangent(self, x: Array, dx: Array, state: State, tangent: State, y: Array, dy: Array) -> None:
        linearise_limit(x, dx, self.reach, self.sample_period, state, tangent, y, dy)

    def c_form(self) -> CForm:
        step = "s->y = smaller(larger(x, s->y - reach), s->y + reach);\nreturn s->y;"
        return CForm(step, "s->y = x;\nreturn x;", {"reach": self.reach}, ("double y",))

    def inverse_terms(self) -> InverseTerms:
        return InverseTerms({"reach": self.reach})

    def inverse_start(self, x: float, state: State) -> InverseStart:
        return InverseStart(dict.fromkeys(("slewed", "pole", "held", "pushed"), state[0]))
