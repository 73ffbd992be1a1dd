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

"""`ChannelBlock`: functions of another measured channel."""

from __future__ import annotations

from abc import abstractmethod

import numpy as np

from ..c_form import CForm, Number
from .block import Array, Block, State, extended


class ChannelBlock(Block):
    """y = x + f(c; θ) with another measured channel c, which the chain passes as the state.

    Without the channel nothing is added.
    """

    keeps_state = True
    channel: str

    @abstractmethod
    def addition(self, c: Array) -> Array:
        """f(c), shape (n,)."""

    @abstractmethod
    def by_parameter(self, c: Array) -> Array:
        """∂f/∂θ, shape (p, n)."""

    def static(self, x0: float) -> float:
        return x0

    def static_slopes(self, x0: float) -> tuple[float, Array]:
        return 1.0, np.zeros(len(self.names))

    def rest(self, x0: float, time: float) -> State:
        return None

    def rest_tangent(self, x0: float, dx0: Array) -> State:
        return None

    def run(self, x: Array, state: State) -> tuple[Array, State]:
        return (x if state is None else x + self.addition(state)), None

    def linearise(self, x: Array, dx: Array, state: State, tangent: State) -> tuple[Array, Array, State, State]:
        rows = extended(dx, len(self.names))
        rows[len(dx) :] = 0.0 if state is None else self.by_parameter(state)
        return self.run(x, state)[0], rows, None, None

    def added_in_c(self, value: str, **numbers: Number) -> CForm:
        """C form from the C expression `value` of f(c)."""
        return CForm(f"return x + {value};", "return x;", numbers, channel=self.channel)

    def inverted(self, name: str) -> None:
        return None
