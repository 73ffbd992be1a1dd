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

"""Mechanical play before the hysteresis."""

from __future__ import annotations

from typing import Self

from ...blocks.block import Array, Block, State
from ...blocks.held import HeldBlock
from ...blocks.kernel import kernel
from ...c_form import CForm
from ...inverse_terms import InverseStart, InverseTerms
from ...parameter import Parameter
from ..effect import ChainPosition, Discretisation, Effect
from ..extent import Extent
from ..hysteresis.play import play_positions
from ..invertibility import Invertibility

START_VALUES = (0.001, 0.002, 0.005, 0.01)
"""Start values of the half width, as shares of the drive range."""


class Backlash(Effect):
    """Backlash between drive and actuator, centred at rest.

    Parameters
    ----------
    b : float
        Half width of the play [V].
    """

    name = "backlash"
    invertibility = Invertibility.EXACT
    family = "hysteresis"
    place = ChainPosition.DRIVE
    equation = "y_i = max(x_i − b, min(x_i + b, y_(i−1)))"
    signature = "The gain drops for signals smaller than b. ARX models fitted at two noise amplitudes disagree"
    source = "play operator; 0.1–1 % of range"
    parameters = (Parameter("b", "b", "V", 0.0, 0.0, 1e3, "half width of the backlash", "play operator", 0.0, 0.02),)

    @classmethod
    def starts(cls, extent: Extent) -> tuple[Self, ...]:
        """Off, and several widths.

        The derivative at width 0 does not predict the effect of a play that is wider than the noise of the drive.
        """
        return cls(), *(cls(b=share * extent.span) for share in START_VALUES)

    def block(self, setting: Discretisation, terms: tuple[Effect, ...] = ()) -> Block:
        return BacklashBlock(self["b"])


@kernel
def linearise_play(x, dx, b, state, tangent, y, dy):
    """`play_positions` y (n,) and derivatives: dx (m, n) to dy (m + 1, n), the last by b; tangent (m + 1,) is updated.

    Where an edge just touches the output, the derivative is the one for a growing parameter.
    """
    m, held = dx.shape[0], state[0]
    for i in range(x.size):
        low, high = x[i] - b, x[i] + b
        if held <= low:
            for j in range(m + 1):
                edge = dx[j, i] if j < m else -1.0
                tangent[j] = edge if held < low else max(tangent[j], edge)
        if held >= high:
            for j in range(m + 1):
                edge = dx[j, i] if j < m else 1.0
                tangent[j] = edge if held > high else min(tangent[j], edge)
        held = max(low, min(high, held))
        y[i] = held
        for j in range(m + 1):
            dy[j, i] = tangent[j]
    state[0] = held


class BacklashBlock(HeldBlock):
    """The play, centred at rest."""

    names = ("backlash.b",)

    def __init__(self, b: float) -> None:
        self.b = b

    def follow(self, x: Array, state: State, y: Array) -> None:
        state[0] = play_positions(x, self.b, state[0], y)

    def follow_tangent(self, x: Array, dx: Array, state: State, tangent: State, y: Array, dy: Array) -> None:
        linearise_play(x, dx, self.b, state, tangent, y, dy)

    def c_form(self) -> CForm:
        step = "s->y = larger(x - b, smaller(x + b, s->y));\nreturn s->y;"
        return CForm(step, "s->y = x;\nreturn x;", {"b": self.b}, ("double y",))

    def inverse_terms(self) -> InverseTerms:
        return InverseTerms({"play": self.b})

    def inverse_start(self, x: float, state: State) -> InverseStart:
        return InverseStart({"held": state[0]})
