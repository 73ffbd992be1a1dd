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
        "and p2 absorb most of the effect"
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


FAR = 1e9
"""Normalised position that no stage reaches [1]."""


def turning_points(s2: float, s3: float) -> tuple[float, float]:
    """The nearest x below and above zero at which x + s2 x² + s3 x³ turns; ∓`FAR` where it does not."""
    square = s2 * s2 - 3.0 * s3
    if square <= 0.0:
        return -FAR, FAR
    half = -(s2 + np.copysign(np.sqrt(square), s2))  # no cancellation
    turns = [float(1.0 / half)]
    if s3 != 0.0:
        turns.append(float(half / (3.0 * s3)))
    return max(x for x in (-FAR, *turns) if x < 0.0), min(x for x in (FAR, *turns) if x > 0.0)


@kernel
def cubic_root(y, s2, s3, lower, upper, x):
    """x (n,) with x + s2 x² + s3 x³ = y (n,) between the turning points; the nearer one if there is no solution."""
    for i in range(y.size):
        low, high = (0.0, upper) if y[i] > 0.0 else (lower, 0.0)
        root = min(max(y[i], 0.5 * low), 0.5 * high)
        for _ in range(200):
            off = y[i] - root - (s2 + s3 * root) * root * root
            if off > 0.0:
                low = root
            else:
                high = root
            slope = 1.0 + (2.0 * s2 + 3.0 * s3 * root) * root
            after = root + off / slope if slope > 0.0 else high
            if not low <= after <= high:
                after = 0.5 * (low + high)
            change, root = after - root, after
            if abs(change) <= 2e-16 * abs(root):
                break
        x[i] = root


CUBIC_ROOT = """\
/* x with x + s2 x^2 + s3 x^3 = y between the turning points; the nearer one if there is none. */
static double cubic_root(double y, double s2, double s3, double lower, double upper)
{
    double low = y > 0.0 ? 0.0 : lower, high = y > 0.0 ? upper : 0.0;
    double root = smaller(larger(y, 0.5 * low), 0.5 * high);
    int k;
    for (k = 0; k < 200; k++) {
        const double off = y - root - (s2 + s3 * root) * root * root;
        const double slope = 1.0 + (2.0 * s2 + 3.0 * s3 * root) * root;
        double after, change;
        if (off > 0.0) {
            low = root;
        } else {
            high = root;
        }
        after = slope > 0.0 ? root + off / slope : high;
        if (!(low <= after && after <= high)) {
            after = 0.5 * (low + high);
        }
        change = after - root;
        root = after;
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
        self.lower, self.upper = turning_points(block.s2, block.s3)

    def run(self, y: Array, state: State, time: Array) -> tuple[Array, State]:
        x = np.empty_like(y)
        cubic_root(y, self.block.s2, self.block.s3, self.lower, self.upper, x)
        return x, None

    def c_form(self, ahead: int) -> CForm:
        numbers = {"s2": self.block.s2, "s3": self.block.s3, "lower": self.lower, "upper": self.upper}
        return CForm("return cubic_root(x, s2, s3, lower, upper);", "", numbers, (), (CUBIC_ROOT,))
