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

"""Blocks in series as one block."""

from __future__ import annotations

import numpy as np

from ..block import Array, Block, State


class SeriesBlock(Block):
    """Blocks in series."""

    def __init__(self, members: tuple[Block, ...]) -> None:
        self.members = members
        self.names = tuple(name for member in members for name in member.names)

    def static(self, x0: float) -> float:
        for member in self.members:
            x0 = member.static(x0)
        return x0

    def static_slopes(self, x0: float) -> tuple[float, Array]:
        whole, rows = 1.0, np.empty(0)
        for member in self.members:
            slope, own = member.static_slopes(x0)
            whole, rows, x0 = slope * whole, np.concatenate((slope * rows, own)), member.static(x0)
        return whole, rows

    def rest(self, x0: float, time: float) -> State:
        states = []
        for member in self.members:
            states.append(member.rest(x0, time))
            x0 = member.static(x0)
        return tuple(states)

    def run(self, x: Array, state: State) -> tuple[Array, State]:
        states = []
        for member, s in zip(self.members, state, strict=True):
            x, s = member.run(x, s)
            states.append(s)
        return x, tuple(states)

    def rest_tangent(self, x0: float, dx0: Array) -> State:
        tangents = []
        for member in self.members:
            tangents.append(member.rest_tangent(x0, dx0))
            slope, own = member.static_slopes(x0)
            x0, dx0 = member.static(x0), np.concatenate((slope * dx0, own))
        return tuple(tangents)

    def linearise(self, x: Array, dx: Array, state: State, tangent: State) -> tuple[Array, Array, State, State]:
        states, tangents = list[State](), list[State]()
        for member, s, t in zip(self.members, state, tangent, strict=True):
            x, dx, s, t = member.linearise(x, dx, s, t)
            states.append(s)
            tangents.append(t)
        return x, dx, tuple(states), tuple(tangents)
