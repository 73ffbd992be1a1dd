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

"""Changes of unit in a chain: volts to v and position to metres, with checks of the values."""

from __future__ import annotations

import numpy as np

from ..c_form import CForm
from ..inverse_terms import InverseTerms
from .block import Array, MemorylessBlock, State
from .inverses.inverted_block import InvertedBlock
from .kernel import kernel


@kernel
def take_in(x: Array, factor: float, y: Array) -> bool:
    """y (n,) = factor · x (n,); True if every x_i is finite."""
    outside = 0
    for i in range(x.size):
        y[i] = factor * x[i]
        outside |= not abs(x[i]) < np.inf
    return outside == 0


@kernel
def hand_out(y: Array, factor: float, limit: float) -> bool:
    """y (n,) times `factor` in place; True if every |y_i| is below `limit` afterwards (False with NaN)."""
    outside = 0
    for i in range(y.size):
        y[i] *= factor
        outside |= not abs(y[i]) < limit
    return outside == 0


class ChangeOfUnit(MemorylessBlock):
    """y = factor · x."""

    def __init__(self, factor: float) -> None:
        self.factor = factor

    def value(self, x: Array) -> Array:
        return x * self.factor

    def slope(self, x: Array) -> Array:
        return np.full(x.size, self.factor)

    def by_parameter(self, x: Array) -> Array:
        return np.empty((0, x.size))

    def linearise(self, x: Array, dx: Array, state: State, tangent: State) -> tuple[Array, Array, State, State]:
        dx *= self.factor
        return x * self.factor, dx, None, None

    def c_form(self) -> CForm:
        return CForm("return factor * x;", numbers={"factor": self.factor})

    def inverse_terms(self) -> InverseTerms:
        return InverseTerms({"per_volt": self.factor})

    def inverted(self, name: str) -> InvertedBlock:
        return InvertedFactor(self.factor)


class InvertedFactor(InvertedBlock):
    """y = factor · x."""

    def __init__(self, factor: float) -> None:
        self.factor = factor

    def run(self, y: Array, state: State, time: Array) -> tuple[Array, State]:
        return y / self.factor, None

    def c_form(self, ahead: int) -> CForm:
        return CForm("return x / factor;", numbers={"factor": self.factor})
