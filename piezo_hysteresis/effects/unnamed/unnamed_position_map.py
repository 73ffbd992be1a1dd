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

"""A correction without a name that depends on the position of the stage."""

from __future__ import annotations

import numpy as np

from ...blocks.block import Array, Block, MemorylessBlock
from ...blocks.kernel import kernel
from ...c_form import CForm, Number
from ...errors import ParameterError
from ...parameter import Parameter
from ..effect import Discretisation, Effect
from ..invertibility import Invertibility
from .unnamed_correction import CorrectionShape, UnnamedCorrection


class UnnamedPositionMap(UnnamedCorrection):
    """A small deviation that is a function of the position, without a physical name.

    Parameters
    ----------
    m : sequence of float
        Deviations at equally spaced positions between ``low`` and ``high``, at least 1 [1].
    low, high : float
        Positions at which the deviation begins and ends [normalised, 1].

    Notes
    -----
    The deviation is linear between the positions. It is zero at ``low``, at ``high`` and outside, where no positions
    were recorded. The map rises everywhere, so that every reading corresponds to one position.
    """

    name = "unnamed_position_map"
    invertibility = Invertibility.IMPOSSIBLE
    equation = "y = x + Σ_k m_k φ_k(x),  φ_k: triangles on a uniform grid from x_low to x_high"
    signature = "The residual is the same function of the position at every rate and amplitude"
    source = "monotone map, piecewise linear"
    depends_on = "position"
    parameters = (
        Parameter(
            "m", "m_k", "1", (0.0,) * 8, -0.05, 0.05, "deviation at the k-th position", "fit", 0.0, 0.002, powers=(0, 1)
        ),
        Parameter(
            "low", "x_low", "1", 0.0, -10.0, 10.0, "lowest position recorded", "records", fixed=True, powers=(0, 1)
        ),
        Parameter(
            "high", "x_high", "1", 1.0, -10.0, 10.0, "highest position recorded", "records", fixed=True, powers=(0, 1)
        ),
    )

    def check(self) -> None:
        low, high, m = self["low"], self["high"], self.array("m")
        if not (high > low and m.size):
            raise ParameterError(
                f"{self.name}: got {m.size} deviations m from low = {low:g} to high = {high:g}, expected at least one, "
                "and high above low"
            )
        if np.diff(self._heights).min() <= -self._step:
            raise ParameterError(f"{self.name}.m: got x + deviation that falls with x, expected one that always rises")

    @property
    def _heights(self) -> Array:
        return np.concatenate(([0.0], self.array("m"), [0.0]))

    @property
    def _step(self) -> float:
        return (self["high"] - self["low"]) / (self.array("m").size + 1)

    def shape(self, displacement_scale: float) -> CorrectionShape:
        x = np.linspace(self["low"], self["high"], self._heights.size)
        return CorrectionShape(
            "position", "m", displacement_scale * x, "deviation", "m", displacement_scale * self._heights
        )

    def block(self, setting: Discretisation, terms: tuple[Effect, ...] = ()) -> Block:
        return UnnamedPositionMapBlock(self._heights, self["low"], self._step)


@kernel
def bend(x, heights, low, step, y):
    """Output y (n,): x (n,) plus the deviation `heights` (k,) on the grid low, low + step, …, which is zero outside."""
    for i in range(x.size):
        at = (x[i] - low) / step
        y[i] = x[i]
        if 0.0 < at < heights.size - 1.0:
            k = int(at)
            y[i] += heights[k] + (at - k) * (heights[k + 1] - heights[k])


@kernel
def hats(x, low, step, rows):
    """Derivatives ∂y/∂m_k at x (n,), written to rows (k, n), which must contain zeros."""
    count = rows.shape[0] + 2
    for i in range(x.size):
        at = (x[i] - low) / step
        if 0.0 < at < count - 1.0:
            k = int(at)
            if k > 0:
                rows[k - 1, i] = 1.0 - (at - k)
            if k < count - 2:
                rows[k, i] = at - k


BEND = """\
const double at = (x - low) / step;
if (at > 0.0 && at < SIZE - 1.0) {
    const int k = (int)at;
    return x + (heights[k] + (at - k) * (heights[k + 1] - heights[k]));
}
return x;"""
"""C code of `bend` for one sample."""


class UnnamedPositionMapBlock(MemorylessBlock):
    """x + Σ_k m_k φ_k(x); heights (k + 2,) with the two ends, which are zero."""

    def __init__(self, heights: Array, low: float, step: float) -> None:
        self.names = tuple(f"unnamed_position_map.m[{k}]" for k in range(heights.size - 2))
        self.heights, self.low, self.step = heights, low, step

    def value(self, x: Array) -> Array:
        y = np.empty_like(x)
        bend(x, self.heights, self.low, self.step, y)
        return y

    def slope(self, x: Array) -> Array:
        at = np.floor((x - self.low) / self.step)
        inside = (x > self.low) & (at < self.heights.size - 1.0)
        rise = np.diff(self.heights) / self.step
        return 1.0 + np.where(inside, rise[np.clip(at, 0, rise.size - 1).astype(int)], 0.0)

    def by_parameter(self, x: Array) -> Array:
        rows = np.zeros((len(self.names), x.size))
        hats(np.ascontiguousarray(x), self.low, self.step, rows)
        return rows

    def c_form(self) -> CForm:
        numbers: dict[str, Number] = {
            "SIZE": self.heights.size,
            "low": self.low,
            "step": self.step,
            "heights": self.heights,
        }
        return CForm(BEND, numbers=numbers)
