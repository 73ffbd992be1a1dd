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

"""Start values of the modified Bouc-Wen operator from its loops (paper, Sec. 3.4). The user gives no initial values.

For given β and γ the state is proportional to A. A negative A gives the same loop as a positive A with −γ. Let g be the
state for A = 1. Then

    w = p1 v³ + p2 v + A·g(v; β, γ·sgn A) + offset

is linear in p1, p2, A and the offset of each record. Only β and γ/β are searched, on a grid and then by a local search.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import scipy

from ...blocks.block import Array
from ...blocks.bouc_wen.bouc_wen_kernel import LOOP_OFF, run_plain
from .operator import POINTS, Loop, range_of, thinned

LOSSES = np.geomspace(0.3, 100.0, 14)
"""Grid of β, for v divided by its range."""
RATIOS = np.linspace(-0.9, 0.9, 7)
"""Grid of γ·sgn(A)/β; |γ| ≤ β keeps the loop bounded."""
LOCAL_SEARCHES = 3
"""Largest number of grid points from which a local search starts."""
ALIKE = 1e-3
"""Singular value below which terms count as the same. On a drive of two levels v³, v and g are nearly equal, and noise
would give them large coefficients that cancel each other."""
LARGEST_COST = 10.0
"""A local search starts only from grid points whose cost is below this multiple of the smallest cost."""


def _state(loops: Sequence[Loop], beta: float, gamma: float) -> list[Array]:
    """State g of every loop for A = 1."""
    numbers = LOOP_OFF.copy()
    numbers[:3] = 1.0, beta, gamma
    state, result = np.zeros(2), []
    for index, loop in enumerate(loops):
        if index == 0 or not loop.continues:
            state = np.array([0.0, loop.start])
        g = np.empty_like(loop.v)
        run_plain(loop.v, numbers, 0.0, 0.0, state, g)
        result.append(g)
    return result


class _Search:
    """Linear least squares inside the nonlinear search, on loops with fewer points."""

    def __init__(self, loops: Sequence[Loop]) -> None:
        share = POINTS // max(1, sum(loop.weight > 0 for loop in loops))
        self.loops = [thinned(loop, max(share, 500)) for loop in loops]
        self.used = [i for i, loop in enumerate(self.loops) if loop.weight > 0]
        self.roots = [np.sqrt(loop.weight / loop.v.size) for loop in self.loops]
        self.fixed = self._stack([np.column_stack((loop.v**3, loop.v)) for loop in self.loops])
        self.target = self._stack([loop.w for loop in self.loops])

    def _stack(self, columns: Sequence[Array]) -> Array:
        """All records in one array, each weighted and with its mean subtracted."""
        return np.concatenate([self.roots[i] * (columns[i] - columns[i].mean(axis=0)) for i in self.used])

    def solve(self, beta: float, ratio: float) -> tuple[Array, Array]:
        """(p1, p2, A) and the weighted residuals."""
        g = self._stack(_state(self.loops, beta, ratio * beta))
        matrix = np.column_stack((self.fixed, g))
        scale = np.maximum(np.linalg.norm(matrix, axis=0), 1e-300)
        theta = np.linalg.lstsq(matrix / scale, self.target, rcond=ALIKE)[0] / scale
        return theta, self.target - matrix @ theta


def closest_loop(loops: Sequence[Loop]) -> dict[str, float]:
    """Values A, beta, gamma, p1, p2 of the operator closest to the loops; β ≥ |γ|.

    Parameters
    ----------
    loops : sequence of Loop
        Loops in experiment order; loops with weight 0 only determine the state.

    Raises
    ------
    IdentificationError
        If no loop has weight, or the input does not move.
    """
    span = range_of(loops)
    search = _Search([replace(loop, v=loop.v / span, start=loop.start / span) for loop in loops])
    costs = np.array([[float(np.sum(search.solve(beta, ratio)[1] ** 2)) for ratio in RATIOS] for beta in LOSSES])
    polished = [
        scipy.optimize.least_squares(
            lambda x: search.solve(np.exp(x[0]), x[1])[1],
            [np.log(LOSSES[i]), RATIOS[j]],
            bounds=([np.log(LOSSES[0] / 10.0), -1.0], [np.log(LOSSES[-1] * 10.0), 1.0]),
            x_scale=[1.0, 0.3],
        )
        for i, j in _local_minima(costs)
    ]
    found = min(polished, key=lambda outcome: float(outcome.cost))
    beta, ratio = float(np.exp(found.x[0])), float(found.x[1])
    p1, p2, a = (float(c) for c in search.solve(beta, ratio)[0])
    gamma = beta * ratio * float(np.copysign(1.0, a))
    return {"A": a / span, "beta": beta / span, "gamma": gamma / span, "p1": p1 / span**3, "p2": p2 / span}


def _local_minima(costs: Array) -> list[tuple[int, int]]:
    """Local minima on the grid, lowest first; for loops of one amplitude there are several."""
    lowest = scipy.ndimage.minimum_filter(costs, size=3, mode="nearest")
    places = np.argwhere((costs == lowest) & (costs <= LARGEST_COST * costs.min()))
    order = np.argsort([costs[i, j] for i, j in places])
    return [(int(i), int(j)) for i, j in places[order][:LOCAL_SEARCHES]]
