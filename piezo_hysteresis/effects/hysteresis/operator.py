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

"""`HysteresisOperator`: the effect that is the hysteresis of a chain, available as `Model.hysteresis`.

Another operator (Preisach, Prandtl-Ishlinskii, …) is one class derived from it. Identification, diagnosis and report
use this interface and no names of effects.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from ...blocks.block import Array
from ...errors import IdentificationError
from ..effect import ChainPosition, Discretisation, Effect, Term

POINTS = 6000
"""Approximate number of points of the data for a search of start values."""


@dataclass(frozen=True, eq=False, slots=True)
class Loop:
    """Input and output of the hysteresis in one record.

    Parameters
    ----------
    v : (n,) array
        Normalised input.
    w : (n,) array
        Hysteresis output.
    continues : bool
        True if the loop starts with the final state of the loop before it.
    start : float
        v at which the stage had settled before the loop, if the loop does not continue another one.
    weight : float
        Weight in the search; 0 if the record only determines the state.
    """

    v: Array
    w: Array
    continues: bool = False
    start: float = 0.0
    weight: float = 1.0


class HysteresisOperator(Effect):
    """From the normalised input v to the hysteresis output w, with parameters for its size and for its shape."""

    family = "hysteresis"
    place = ChainPosition.HYSTERESIS

    gain_names: ClassVar[tuple[str, ...]]
    """Parameters to which w is proportional: w doubles if all of them are doubled."""
    memory_names: ClassVar[tuple[str, ...]] = ()
    """Parameters that have no meaning if the memory is switched off."""
    start_term: ClassVar[type[Term] | None] = None
    """Term for the state at rest of a stage that was driven before; None if there is none."""

    def fitted_names(self) -> tuple[str, ...]:
        """Names of the numbers that a fit adjusts: ``"beta"``, or ``"c[0]"`` for elements of an array parameter."""
        chosen = {row.name for row in self.parameters if row.fixed or row.per_record}
        return tuple(n for n in self.free_names() if n.partition("[")[0] not in chosen)

    def gain_numbers(self) -> tuple[str, ...]:
        """Names of the single numbers of `gain_names`."""
        return tuple(n for n in self.free_names() if n.partition("[")[0] in self.gain_names)

    def linear_numbers(self) -> tuple[str, ...]:
        """Names of the numbers to which w is proportional with and without the memory of the operator."""
        return tuple(n for n in self.gain_numbers() if n.partition("[")[0] not in self.memory_names)

    def scaled(self, factor: float) -> Self:
        """The same operator with `factor` times the output."""
        changed = {n: factor * self.array(n) for n in self.gain_names}
        return self.with_values(**{n: tuple(v.tolist()) if v.ndim else float(v) for n, v in changed.items()})

    @property
    def has_memory(self) -> bool:
        """False if the parameters switch the memory off, so that w is a function of v alone."""
        return True

    def memoryless(self) -> Self | None:
        """The same operator with its memory switched off; None if it has no such form."""
        return None

    def exact(self) -> HysteresisOperator:
        """The operator with an exact step, which can have terms of the catalogue; usually the operator itself.

        Raises
        ------
        ModelError
            If there is none for these values.
        """
        return self

    @property
    @abstractmethod
    def turning_slope(self) -> float:
        """∂w/∂v just after a turning point, at v = 0 [1]: the gain for small fast motion."""

    def shaped(self, low: float, high: float) -> Self:
        """The same operator with the start values of its shape.

        Parameters
        ----------
        low, high : float
            Smallest and largest v of the loops.
        """
        return self

    def started(self, loops: Sequence[Loop]) -> Self:
        """The operator closest to the loops, without start values: shape from `shaped`, gains by least squares.

        Parameters
        ----------
        loops : sequence of Loop
            Loops in experiment order; loops with weight 0 only determine the state.

        Raises
        ------
        IdentificationError
            If no loop has weight, or the input does not move.
        """
        from scipy.optimize import lsq_linear  # takes 0.1 s to import, which would delay the start of nodes

        range_of(loops)
        moved = [loop for loop in loops if loop.weight > 0]
        low = min(float(min(loop.v.min(), loop.start)) for loop in moved)
        high = max(float(max(loop.v.max(), loop.start)) for loop in moved)
        shape = self.shaped(low, high)
        thin = [thinned(loop, max(POINTS // len(moved), 500)) for loop in loops]
        used = [i for i, loop in enumerate(thin) if loop.weight > 0]
        roots = [np.sqrt(loop.weight / loop.v.size) for loop in thin]

        def stacked(parts: Sequence[Array]) -> Array:
            return np.concatenate([roots[i] * (parts[i] - parts[i].mean()) for i in used])

        sizes = {n: shape.array(n).size for n in self.gain_names}
        width = sum(sizes.values())
        columns = np.column_stack([stacked(outputs(shape._with_gains(row, sizes), thin)) for row in np.eye(width)])
        table = {row.name: row for row in self.parameters}
        limits = [(table[n].lower, table[n].upper) for n, size in sizes.items() for _ in range(size)]
        scale = np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
        bounds = np.transpose(limits) * scale
        found = lsq_linear(columns / scale, stacked([loop.w for loop in thin]), bounds=(bounds[0], bounds[1]))
        return shape._with_gains(found.x / scale, sizes)

    def _with_gains(self, gains: NDArray[np.float64], sizes: dict[str, int]) -> Self:
        cuts = np.split(gains, np.cumsum(list(sizes.values()))[:-1])
        values = dict(zip(sizes, cuts, strict=True))
        arrays = {n: isinstance(self.values[n], tuple) for n in sizes}
        return self.with_values(**{n: tuple(v.tolist()) if arrays[n] else float(v[0]) for n, v in values.items()})


def outputs(operator: HysteresisOperator, loops: Sequence[Loop]) -> list[Array]:
    """Output w (n,) of an operator in every loop; the state continues if a loop continues."""
    block = operator.block(Discretisation(1.0, 1.0))
    state, found = None, []
    for loop in loops:
        if state is None or not loop.continues:
            state = block.rest(loop.start, 0.0)
        w, state = block.run(loop.v, state)
        found.append(w)
    return found


def range_of(loops: Sequence[Loop]) -> float:
    """Largest range of v in the loops with weight.

    Raises
    ------
    IdentificationError
        If there is no such loop, or the input does not move.
    """
    weighted = [loop for loop in loops if loop.weight > 0]
    span = max((float(np.ptp(np.append(loop.v, loop.start))) for loop in weighted), default=0.0)
    if span == 0.0:
        raise IdentificationError(
            f"hysteresis: got {len(weighted)} records whose drive moves by {span:g}, "
            "expected at least one with loops, e.g. a triangle of several amplitudes"
        )
    return span


def thinned(loop: Loop, points: int) -> Loop:
    """The loop with fewer points, including the extremes of v in every segment, so that no turning point is lost."""
    per_bin = -(-3 * loop.v.size // points)
    if per_bin < 4:
        return loop
    whole = loop.v.size // per_bin
    rows = loop.v[: whole * per_bin].reshape(whole, per_bin)
    first = per_bin * np.arange(whole)
    keep = np.unique(
        np.concatenate((first, first + rows.argmin(axis=1), first + rows.argmax(axis=1), [loop.v.size - 1]))
    )
    return Loop(loop.v[keep], loop.w[keep], loop.continues, loop.start, loop.weight)
