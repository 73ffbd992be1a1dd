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

"""Zero of the displacement sensor, and additional settling at rest; part of every comparison with a measurement."""

from __future__ import annotations

import numpy as np

from ...blocks.block import Array, Block, State, extended
from ...blocks.inverses.inverted_block import InvertedBlock
from ...c_form import CForm
from ...parameter import Parameter
from ..effect import ChainPosition, Discretisation, Effect
from ..invertibility import Invertibility


class Offset(Effect):
    """Zero of the sensor, y0, and settling at rest beyond the model, r·y_rest.

    Parameters
    ----------
    y0 : float
        Sensor zero [m].
    settling : float
        r: settling of the stage at rest beyond that of the model, relative to its position there [1].

    Notes
    -----
    The state of creep and hysteresis at the start of a record depends on the motion during the minutes or days before,
    which is not recorded. The fitted ratio r absorbs its influence, which could otherwise be mistaken for another
    effect. r is the same for all records. A sensor that is set to zero before every record has r = −1.

    Examples
    --------
    >>> block = Offset(y0=1e-6, settling=0.1).block(Discretisation(1e-3, 1e-3))
    >>> y, _ = block.run(np.array([1e-5, 2e-5]), block.rest(1e-5, 0.0))
    >>> [round(float(v), 12) for v in y]
    [1.2e-05, 2.2e-05]
    """

    name = "offset"
    invertibility = Invertibility.EXACT
    family = "sensor"
    place = ChainPosition.ENVIRONMENT
    equation = "y = x + y0 + r x_rest"
    signature = "The residual is constant in every record"
    source = "definition of the sensor's zero"
    parameters = (
        Parameter("y0", "y0", "m", 0.0, -1.0, 1.0, "reading at zero displacement", "definition", 0.0, 1e-6),
        Parameter(
            "settling", "r", "1", 0.0, -1.5, 1.5, "additional settling at rest, relative", "definition", 0.0, 0.01
        ),
    )

    def block(self, setting: Discretisation, terms: tuple[Effect, ...] = ()) -> Block:
        return OffsetBlock(self["y0"], self["settling"])


class OffsetBlock(Block):
    """x + y0 + r·x_rest; state x_rest, tangent state its slopes."""

    names = ("offset.y0", "offset.settling")
    keeps_state = True

    def __init__(self, y0: float, settling: float) -> None:
        self.y0, self.settling = y0, settling

    def static(self, x0: float) -> float:
        return x0 + (self.y0 + self.settling * x0)

    def static_slopes(self, x0: float) -> tuple[float, Array]:
        return 1.0 + self.settling, np.array([1.0, x0])

    def rest(self, x0: float, time: float) -> State:
        return x0

    def run(self, x: Array, state: State) -> tuple[Array, State]:
        return x + (self.y0 + self.settling * state), state

    def rest_tangent(self, x0: float, dx0: Array) -> State:
        return np.array(dx0)

    def linearise(self, x: Array, dx: Array, state: State, tangent: State) -> tuple[Array, Array, State, State]:
        rows, settled = extended(dx, 2), self.settling * tangent
        if settled.any():
            rows[:-2] += settled[:, None]
        rows[-2] = 1.0
        rows[-1] = state
        return self.run(x, state)[0], rows, state, tangent

    def c_form(self) -> CForm:
        step = "return x + (y0 + settling * s->x_rest);"
        rest = "s->x_rest = x;\nreturn x + (y0 + settling * x);"
        return CForm(step, rest, {"y0": self.y0, "settling": self.settling}, ("double x_rest",))

    def inverted(self, name: str) -> InvertedBlock:
        return InvertedOffset(self)


class InvertedOffset(InvertedBlock):
    """y = x + y0 + r x_rest."""

    def __init__(self, block: OffsetBlock) -> None:
        self.block = block

    def start(self, x0: float, state: State, ahead: int) -> State:
        return state

    def run(self, y: Array, state: State, time: Array) -> tuple[Array, State]:
        return y - (self.block.y0 + self.block.settling * state), state

    def c_form(self, ahead: int) -> CForm:
        numbers = {"y0": self.block.y0, "settling": self.block.settling}
        step, rest = "return x - (y0 + settling * s->x_rest);", "s->x_rest = x;\nreturn x;"
        return CForm(step, rest, numbers, ("double x_rest",))
