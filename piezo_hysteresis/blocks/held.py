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

"""`HeldBlock`: an output that follows the input only beyond a limit, and is constant otherwise."""

from __future__ import annotations

from abc import abstractmethod

import numpy as np

from .block import Array, Block, State


class HeldBlock(Block):
    """State [y]. At rest the output equals the input, for any value of the parameter."""

    keeps_state = True
    remembered = 1
    """Number of parameters, from the first one on, by which the state has a derivative."""

    @abstractmethod
    def follow(self, x: Array, state: State, y: Array) -> None:
        """Write the next samples to y (n,) and the last one to `state`."""

    @abstractmethod
    def follow_tangent(self, x: Array, dx: Array, state: State, tangent: State, y: Array, dy: Array) -> None:
        """`follow`, with rows dx (m, n) to dy (m + p, n) for p parameters; `tangent` (m + remembered,) is updated."""

    def static(self, x0: float) -> float:
        return x0

    def static_slopes(self, x0: float) -> tuple[float, Array]:
        return 1.0, np.zeros(len(self.names))

    def rest(self, x0: float, time: float) -> State:
        return np.array([x0])

    def run(self, x: Array, state: State) -> tuple[Array, State]:
        y, state = np.empty_like(x), state.copy()
        self.follow(x, state, y)
        return y, state

    def rest_tangent(self, x0: float, dx0: Array) -> State:
        return np.append(dx0, np.zeros(self.remembered))

    def linearise(self, x: Array, dx: Array, state: State, tangent: State) -> tuple[Array, Array, State, State]:
        y, state, tangent = np.empty_like(x), state.copy(), tangent.copy()
        rows = np.empty((len(dx) + len(self.names), x.size))
        self.follow_tangent(x, np.ascontiguousarray(dx), state, tangent, y, rows)
        return y, rows, state, tangent
