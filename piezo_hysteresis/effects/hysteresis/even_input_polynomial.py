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

"""Even part of the static response, for drives of both signs."""

from __future__ import annotations

import numpy as np

from ...blocks.block import Array, Block, MemorylessBlock
from ...c_form import CForm
from ...inverse_terms import InverseTerms
from ...parameter import Parameter
from ..effect import ChainPosition, Discretisation, Effect
from ..invertibility import Invertibility


class EvenInputPolynomial(Effect):
    """The square and the fourth power of the normalised drive are added to the hysteresis output.

    Parameters
    ----------
    p_e : float
        Square term [1].
    p_4 : float
        Fourth-power term [1].
    """

    name = "even_input_polynomial"
    invertibility = Invertibility.EXACT
    family = "static"
    place = ChainPosition.HYSTERESIS
    equation = "w + p_e v² + p_4 v⁴"
    signature = (
        "The loops differ between the two signs of a bipolar drive. On a unipolar drive p1, p2 and the loop absorb "
        "most of the effect"
    )
    source = "even terms in addition to the odd polynomial of the paper, Eq. (3); its text asks for them"
    parameters = (
        Parameter("p_e", "p_e", "1", 0.0, -1e2, 1e2, "square term", "paper, Sec. 2", 0.0, 0.05, powers=(-2, 1)),
        Parameter("p_4", "p_4", "1", 0.0, -1e2, 1e2, "fourth-power term", "paper, Sec. 2", 0.0, 0.05, powers=(-4, 1)),
    )

    def block(self, setting: Discretisation, terms: tuple[Effect, ...] = ()) -> Block:
        return EvenInputPolynomialBlock(self["p_e"], self["p_4"])


class EvenInputPolynomialBlock(MemorylessBlock):
    """p_e v² + p_4 v⁴, a summand of w."""

    names = ("even_input_polynomial.p_e", "even_input_polynomial.p_4")

    def __init__(self, p_e: float, p_4: float) -> None:
        self.p_e, self.p_4 = p_e, p_4

    def value(self, x: Array) -> Array:
        return (self.p_e + self.p_4 * (x * x)) * (x * x)

    def slope(self, x: Array) -> Array:
        return (2.0 * self.p_e + 4.0 * self.p_4 * (x * x)) * x

    def by_parameter(self, x: Array) -> Array:
        return np.vstack((x * x, (x * x) * (x * x)))

    def c_form(self) -> CForm:
        return CForm("return (p_e + p_4 * (x * x)) * (x * x);", numbers={"p_e": self.p_e, "p_4": self.p_4})

    def inverse_terms(self) -> InverseTerms:
        return InverseTerms(polynomial={"p_e": self.p_e, "p_4": self.p_4})
