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

"""Nonlinearity of the displacement sensor."""

from __future__ import annotations

import numpy as np

from ...blocks.block import Array, Block, MemorylessBlock, State
from ...blocks.inverses.inverted_block import InvertedBlock
from ...blocks.kernel import kernel
from ...c_form import CForm
from ...parameter import Parameter
from ..effect import ChainPosition, Discretisation, Effect
from ..invertibility import Invertibility


class SensorNonlinearity(Effect):
    """The sensor adds the square and the cube of the position to its reading.

    Parameters
    ----------
    s2 : float
        Square term [1].
    s3 : float
        Cubic term [1].

    Notes
    -----
    The terms act on the normalised position. If the ``displacement_scale`` of the model is the stroke, s2 and s3 are
    relative errors at full scale.
    """

    name = "sensor_nonlinearity"
    invertibility = Invertibility.EXACT
    family = "static"
    place = ChainPosition.SENSOR
    equation = "y = x + s2 x² + s3 x³"
    signature = (
        "The residual contains harmonics of the position, also at the resonance. On a unipolar drive p1 "
        "and p2 absorb the effect"
    )
    source = "capacitive sensors 0.02–0.1 %, strain gauges 0.1–1 %"
    parameters = (
        Parameter("s2", "s2", "1", 0.0, -1.0, 1.0, "square term", "sensor data sheets", 0.0, 0.01, powers=(0, -1)),
        Parameter("s3", "s3", "1", 0.0, -1.0, 1.0, "cubic term", "sensor data sheets", 0.0, 0.01, powers=(0, -2)),
    )

    def block(self, setting: Discretisation, terms: tuple[Effect, ...] = ()) -> Block:
        return SensorNonlinearityBlock(self["s2"], self["s3"])


class SensorNonlinearityBlock(MemorylessBlock):
    """x + s2 x² + s3 x³."""

    names = ("sensor_nonlinearity.s2", "sensor_nonlinearity.s3")

    def __init__(self, s2: float, s3: float) -> None:
        self.s2, self.s3 = s2, s3

    def value(self, x: Array) -> Array:
        return x + (self.s2 + self.s3 * x) * x * x

    def slope(self, x: Array) -> Array:
        return 1.0 + (2.0 * self.s2 + 3.0 * self.s3 * x) * x

    def by_parameter(self, x: Array) -> Array:
        return np.vstack((x * x, x * x * x))

    def c_form(self) -> CForm:
        return CForm("return x + (s2 + s3 * x) * x * x;", numbers={"s2": self.s2, "s3": self.s3})

    def inverted(self, name: str) -> InvertedBlock:
        return InvertedCubic(self)


@kernel
def cubic_root(y, s2, s3, x):
    """x (n,) with x + s2 x² + s3 x³ = y (n,), on the branch through zero; its extremum if there is no solution."""
    for i in range(y.size):
        root = y[i]
        for _ in range(60):
            slope = 1.0 + (2.0 * s2 + 3.0 * s3 * root) * root
            if slope < 1e-3:
                root *= 0.9
                continue
            change = (y[i] - root - (s2 + s3 * root) * root * root) / slope
            root += change
            if abs(change) <= 2e-16 * abs(root):
                break
        x[i] = root


CUBIC_ROOT = """\
/* x with x + s2 x^2 + s3 x^3 = y, the one joined to zero; else the turning point. */
static double cubic_root(double y, double s2, double s3)
{
    double root = y;
    int k;
    for (k = 0; k < 60; k++) {
        const double slope = 1.0 + (2.0 * s2 + 3.0 * s3 * root) * root;
        double change;
        if (slope < 1e-3) {
            root *= 0.9;
            continue;
        }
        change = (y - root - (s2 + s3 * root) * root * root) / slope;
        root += change;
        if (fabs(change) <= 2e-16 * fabs(root)) {
            break;
        }
    }
    return root;
}
"""
"""C function of `cubic_root`."""


class InvertedCubic(InvertedBlock):
    """y = x + s2 x² + s3 x³."""

    def __init__(self, block: SensorNonlinearityBlock) -> None:
        self.block = block

    def run(self, y: Array, state: State, time: Array) -> tuple[Array, State]:
        x = np.empty_like(y)
        cubic_root(y, self.block.s2, self.block.s3, x)
        return x, None

    def c_form(self, ahead: int) -> CForm:
        numbers = {"s2": self.block.s2, "s3": self.block.s3}
        return CForm("return cubic_root(x, s2, s3);", "", numbers, (), (CUBIC_ROOT,))
