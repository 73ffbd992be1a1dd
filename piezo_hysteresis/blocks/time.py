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

"""`TimeBlock`: functions of absolute time."""

from __future__ import annotations

from abc import abstractmethod

import numpy as np

from ..c_form import CForm, Number
from .block import Array, Block, State, extended, scale
from .inverses.inverted_block import InvertedBlock


class TimeBlock(Block):
    """y = x + d(t; θ), or x·(…): functions of time.

    The state is (time t at which the sample period began, samples since, time of the experiment at which t = 0).
    """

    from_rest = False
    """Whether t counts from the last rest, and not from the start of the experiment."""

    def __init__(self, sample_period: float) -> None:
        self.sample_period = sample_period

    @abstractmethod
    def value(self, x: Array, t: Array) -> Array:
        """y for inputs x and times t [s], both (n,)."""

    def slope(self, x: Array, t: Array) -> Array:
        """∂y/∂x, shape (n,)."""
        return np.ones_like(x)

    @abstractmethod
    def by_parameter(self, x: Array, t: Array) -> Array:
        """∂y/∂θ, shape (p, n)."""

    def static(self, x0: float) -> float:
        return x0

    def static_slopes(self, x0: float) -> tuple[float, Array]:
        return 1.0, np.zeros(len(self.names))

    def rest(self, x0: float, time: float) -> State:
        return (0.0, 0, time) if self.from_rest else (time, 0, 0.0)

    def resume(self, x: float, state: State, time: float) -> State:
        origin = state[2]
        return time - origin, 0, origin

    def rest_tangent(self, x0: float, dx0: Array) -> State:
        return None

    def _times(self, n: int, state: State) -> tuple[Array, State]:
        start, count, origin = state
        return start + self.sample_period * (count + np.arange(n)), (start, count + n, origin)

    def run(self, x: Array, state: State) -> tuple[Array, State]:
        t, state = self._times(x.size, state)
        return self.value(x, t), state

    def value_in_c(self, code: str, **numbers: Number) -> CForm:
        """C form from C `code` that returns the value for x and t."""
        step = f"const double t = period * s->count;\ns->count += 1.0;\n{code}"
        rest = "s->count = 0.0;\nreturn x;"
        return CForm(step, rest, {"period": self.sample_period, **numbers}, ("double count",))

    def linearise(self, x: Array, dx: Array, state: State, tangent: State) -> tuple[Array, Array, State, State]:
        t, state = self._times(x.size, state)
        m, rows = len(dx), extended(dx, len(self.names))
        scale(rows[:m], self.slope(x, t))
        rows[m:] = self.by_parameter(x, t)
        return self.value(x, t), rows, state, None

    def inverted(self, name: str) -> InvertedBlock | None:
        return InvertedAddition(self)


def at_time(step: str, block: TimeBlock, ahead: int) -> CForm | str:
    """C form that calls the forward function of a block as part `forward`, `ahead` samples later."""
    forward = block.c_form()
    if isinstance(forward, str):
        return forward
    rest = "ME_forward_rest(&s->forward, x);\ns->forward.count = ahead;\nreturn x;"
    return CForm(step, rest, {"ahead": float(ahead)}, parts={"forward": forward})


class InvertedAddition(InvertedBlock):
    """y = x + d(t)."""

    def __init__(self, block: TimeBlock) -> None:
        self.block = block

    def run(self, y: Array, state: State, time: Array) -> tuple[Array, State]:
        return y - self.block.value(np.zeros_like(y), time), None

    def c_form(self, ahead: int) -> CForm | str:
        return at_time("return x - ME_forward_step(&s->forward, 0.0);", self.block, ahead)
