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

"""`Block`: an effect at one sample period, which can run and propagate sensitivities.

A block maps samples x to samples y. *Rest* is the state after a long time at the constant input x0. Sensitivities are
rows: `linearise` takes ∂x/∂θ of all parameters upstream, shape (m, n), and returns these m rows after the block,
followed by the rows of the block's own parameters `names`. It may change the rows that it takes, and if these are the
first ones of a larger array, it may write its own rows behind them. So a chain can use one array for all its blocks.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..c_form import CForm
from ..errors import ModelError
from ..inverse_terms import InverseStart, InverseTerms, started_together, summed
from .inverses.inverted_block import InvertedBlock

Array = NDArray[np.float64]
State = Any
"""State of a block, used by this block only."""
Section = tuple[Array, Array]
"""Numerator and denominator of a transfer function, in powers of z⁻¹; the denominator begins with 1."""


def extended(dx: Array, added: int) -> Array:
    """Rows dx (m, n) and `added` further ones, not yet filled, behind them: dx itself if its array has room for them.

    >>> room = np.zeros((3, 2))
    >>> extended(room[:1], 2).base is room, extended(room[:1], 3).base is room
    (True, False)
    """
    m, n = dx.shape
    room = dx.base
    if room is not None and room.shape[1:] == (n,) and len(room) >= m + added and _start(room) == _start(dx):
        return room[: m + added]
    rows = np.empty((m + added, n))
    rows[:m] = dx
    return rows


def _start(rows: Array) -> tuple[int, tuple[int, ...]]:
    return rows.__array_interface__["data"][0], rows.strides


def scale(rows: Array, slope: Array) -> None:
    """Multiply rows (m, n) by a slope (n,) in place; that of an effect that is off is 1."""
    if (slope != 1.0).any():
        rows *= slope


class Block(ABC):
    """One effect at one sample period.

    Attributes
    ----------
    names : tuple of str
        Own parameters, in the order of the own rows of `linearise`; the same at every sample period.
    keeps_state : bool
        True if the state does not depend on the sample period and can be used for a record with another period.
    """

    names: tuple[str, ...] = ()
    keeps_state: bool = False

    @abstractmethod
    def static(self, x0: float) -> float:
        """Output of a stage at rest at x0."""

    @abstractmethod
    def static_slopes(self, x0: float) -> tuple[float, Array]:
        """∂static/∂x0, and ∂static/∂θ for the own parameters, shape (p,)."""

    def static_at(self, x0: float, time: float) -> float:
        """`static` at a time [s], for the blocks after one whose factor depends on time."""
        return self.static(x0)

    def static_slopes_at(self, x0: float, time: float) -> tuple[float, Array]:
        """`static_slopes` at a time [s]."""
        return self.static_slopes(x0)

    @abstractmethod
    def rest(self, x0: float, time: float) -> State:
        """State of a stage settled at x0; `time` is that of the first sample [s]."""

    def resume(self, x: float, state: State, time: float) -> State:
        """State after one of the same block at another sample period; x is its last input, `time` the present one."""
        return state if self.keeps_state else self.rest(x, time)

    @abstractmethod
    def run(self, x: Array, state: State) -> tuple[Array, State]:
        """Next samples: y of shape (n,), and the state after them."""

    def run_into(self, x: Array, state: State, y: Array) -> State:
        """`run` with the output written to y (n,); override it if this saves a copy."""
        y[:], state = self.run(x, state)
        return state

    @abstractmethod
    def rest_tangent(self, x0: float, dx0: Array) -> State:
        """Tangent state at rest, for incoming sensitivities dx0 of shape (m,)."""

    @abstractmethod
    def linearise(self, x: Array, dx: Array, state: State, tangent: State) -> tuple[Array, Array, State, State]:
        """`run`, and the sensitivities: y (n,), dy (m + p, n), state, tangent state.

        dx (m, n), and the rows behind it in its array, belong to the block and may be changed.
        """

    def c_form(self) -> CForm | str:
        """The block as C code, equivalent to `run`; or the reason why there is none, for a message."""
        return "has no C form"

    def sections(self) -> tuple[Section, ...]:
        """Transfer functions whose series connection is the block; none if it is not linear or not of finite order."""
        return ()

    def inverse_terms(self) -> InverseTerms | None:
        """Terms of the block in the inverse of drive, hysteresis and creep; None if it is not a part of these."""
        return None

    def inverse_start(self, x: float, state: State) -> InverseStart:
        """State of that inverse, from the last input of the block and its state after it."""
        return InverseStart()

    def inverted(self, name: str) -> InvertedBlock | None:
        """Inverse of a block after the creep that has no `sections`; None if the drive does not influence the block.

        Raises
        ------
        ModelError
            If the block has no inverse; the message begins with `name`.
        """
        raise ModelError(f"{name}: {type(self).__name__} has no inverse; expected a block that compensation can invert")


class MemorylessBlock(Block):
    """y_i = f(x_i; θ)."""

    keeps_state = True

    @abstractmethod
    def value(self, x: Array) -> Array:
        """f(x), shape (n,)."""

    @abstractmethod
    def slope(self, x: Array) -> Array:
        """∂f/∂x, shape (n,)."""

    @abstractmethod
    def by_parameter(self, x: Array) -> Array:
        """∂f/∂θ, shape (p, n)."""

    def static(self, x0: float) -> float:
        return float(self.value(np.array([x0]))[0])

    def static_slopes(self, x0: float) -> tuple[float, Array]:
        at = np.array([x0])
        return float(self.slope(at)[0]), self.by_parameter(at)[:, 0]

    def rest(self, x0: float, time: float) -> State:
        return None

    def run(self, x: Array, state: State) -> tuple[Array, State]:
        return self.value(x), None

    def rest_tangent(self, x0: float, dx0: Array) -> State:
        return None

    def linearise(self, x: Array, dx: Array, state: State, tangent: State) -> tuple[Array, Array, State, State]:
        m, rows = len(dx), extended(dx, len(self.names))
        scale(rows[:m], self.slope(x))
        rows[m:] = self.by_parameter(x)
        return self.value(x), rows, None, None


class SumBlock(Block):
    """Parallel blocks with the same input; the output is the sum of their outputs."""

    keeps_state = True

    def __init__(self, members: tuple[Block, ...], labels: tuple[str, ...] = ()) -> None:
        self.members, self.labels = members, labels or tuple(f"part_{k}" for k in range(len(members)))
        self.names = tuple(name for member in members for name in member.names)

    def static(self, x0: float) -> float:
        return sum(m.static(x0) for m in self.members)

    def static_slopes(self, x0: float) -> tuple[float, Array]:
        slopes = [m.static_slopes(x0) for m in self.members]
        return sum(s for s, _ in slopes), np.concatenate([own for _, own in slopes])

    def rest(self, x0: float, time: float) -> State:
        return tuple(m.rest(x0, time) for m in self.members)

    def run(self, x: Array, state: State) -> tuple[Array, State]:
        outputs, states = zip(*(m.run(x, s) for m, s in zip(self.members, state, strict=True)), strict=True)
        return sum(outputs[1:], outputs[0]), states

    def inverse_terms(self) -> InverseTerms | None:
        return summed([m.inverse_terms() for m in self.members])

    def inverse_start(self, x: float, state: State) -> InverseStart:
        return started_together([m.inverse_start(x, s) for m, s in zip(self.members, state, strict=True)])

    def rest_tangent(self, x0: float, dx0: Array) -> State:
        return tuple(m.rest_tangent(x0, dx0) for m in self.members)

    def linearise(self, x: Array, dx: Array, state: State, tangent: State) -> tuple[Array, Array, State, State]:
        m, rows = len(dx), extended(dx, len(self.names))
        y, before, done = np.zeros_like(x), dx.copy(), m
        states, tangents = list[State](), list[State]()
        rows[:m] = 0.0
        for member, s, t in zip(self.members, state, tangent, strict=True):
            part, dpart, s, t = member.linearise(x, before.copy(), s, t)
            y += part
            rows[:m] += dpart[:m]
            rows[done : done + len(dpart) - m] = dpart[m:]
            done += len(dpart) - m
            states.append(s)
            tangents.append(t)
        return y, rows, tuple(states), tuple(tangents)

    def c_form(self) -> CForm | str:
        parts: dict[str, CForm] = {}
        for label, member in zip(self.labels, self.members, strict=True):
            form = member.c_form()
            if isinstance(form, str):
                return form
            parts[label] = form
        step, rest = (" + ".join(part.call(f, label, "x") for label, part in parts.items()) for f in ("step", "rest"))
        return CForm(f"return {step};", f"return {rest};", parts=parts)
