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

"""`InvertedBlock`: inverse of one block between the creep and the sensor, from its output to its input."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from ..blocks.block import Block, Section, State
from ..blocks.kernel import kernel
from ..blocks.softening.softened_arx import SoftenedArxBlock, force
from ..blocks.softening.softened_arx_c import FORCE, FORCE_FOR, SETTLE
from ..blocks.time import TimeBlock
from ..c_form import CForm
from ..effects.sensor.gain_drift import GainDriftBlock
from ..effects.sensor.offset import OffsetBlock
from ..effects.sensor.sensor_nonlinearity import SensorNonlinearityBlock
from .linear_inverse import LinearInverse

Array = NDArray[np.float64]


class InvertedBlock(ABC):
    """The inverse of a block.

    Attributes
    ----------
    preview : int
        Number of future samples that must be known.
    is_exact : bool
        Whether run(inverse(y)) equals y up to rounding.
    noise_gain : float
        Largest factor by which rounding errors and noise grow.
    """

    preview: int = 0
    is_exact: bool = True
    noise_gain: float = 1.0

    def start(self, x0: float, state: State) -> State:
        """State from the last input of the block and the state of the block."""
        return None

    @abstractmethod
    def run(self, y: Array, state: State, time: Array) -> tuple[Array, State]:
        """Inputs x (n,) at `time` (n,) [s] that give the wanted outputs y (n,), and the state after them."""

    def c_form(self, ahead: int) -> CForm | str:
        """`run` as C code, beginning `ahead` samples after the start; ``rest`` takes the input x at rest."""
        return "has no C form of its inverse"


class InvertedFactor(InvertedBlock):
    """y = factor · x."""

    def __init__(self, factor: float) -> None:
        self.factor = factor

    def run(self, y: Array, state: State, time: Array) -> tuple[Array, State]:
        return y / self.factor, None

    def c_form(self, ahead: int) -> CForm:
        return CForm("return x / factor;", numbers={"factor": self.factor})


class InvertedLinear(InvertedBlock):
    """Inverse of sections of linear dynamics in series."""

    def __init__(self, block: Block, sections: Iterable[Section], name: str) -> None:
        slope, _ = block.static_slopes(0.0)
        own = list(sections)
        gains = [slope] if len(own) == 1 else [float(b.sum() / a.sum()) for b, a in own]
        self.inverses = [LinearInverse(s, g, name) for s, g in zip(own, gains, strict=True)][::-1]
        self.preview = sum(i.preview for i in self.inverses)
        self.is_exact = all(i.is_exact for i in self.inverses)
        self.noise_gain = float(np.prod([i.noise_gain for i in self.inverses]))

    def start(self, x0: float, state: State) -> State:
        states = []
        for inverse in self.inverses[::-1]:
            states.append(inverse.rest(x0))
            x0 = inverse.gain * x0
        return tuple(states[::-1])

    def run(self, y: Array, state: State, time: Array) -> tuple[Array, State]:
        states = []
        for inverse, s in zip(self.inverses, state, strict=True):
            y, s = inverse.run(y, s)
            states.append(s)
        return y, tuple(states)

    def c_form(self, ahead: int) -> CForm:
        parts = {f"section_{k}": inverse.c_form() for k, inverse in enumerate(self.inverses)}
        steps = [f"x = {part.call('step', name, 'x')};" for name, part in parts.items()]
        rest = [f"{part.call('rest', n, 'x')};\nx = gain_{k} * x;" for k, (n, part) in enumerate(parts.items())][::-1]
        gains = {f"gain_{k}": float(inverse.gain) for k, inverse in enumerate(self.inverses)}
        return CForm("\n".join((*steps, "return x;")), "\n".join((*rest, "return x;")), gains, parts=parts)


@kernel
def force_for(x, x0, p, z, w):
    """w (n,) − w0 for a motion x (n,) of the mode; p = [m1, m2, k2, k3]; z, the last two deflections, is updated."""
    gain, held = 1.0 + p[0] + p[1], force(x0, p[2], p[3])
    for i in range(x.size):
        moved = x[i] - x0
        w[i] = (moved + p[0] * z[0] + p[1] * z[1]) / gain + (force(x0 + z[0], p[2], p[3]) - held)
        z[1], z[0] = z[0], moved


class InvertedSoftening(InvertedBlock):
    """Inverse of a softened mode that drives the rest of G: first the rest, then the force on the mode."""

    def __init__(self, block: SoftenedArxBlock, name: str) -> None:
        self.block = block
        self.path = LinearInverse(block.path.filter.sections()[0], block.arx.gain, name)
        self.preview, self.is_exact, self.noise_gain = self.path.preview, self.path.is_exact, self.path.noise_gain

    def start(self, x0: float, state: State) -> State:
        settled = self.block.settled.static(x0)
        return x0, self.path.rest(settled), np.zeros(2)

    def run(self, y: Array, state: State, time: Array) -> tuple[Array, State]:
        w0, path, z = state
        x, path = self.path.run(y, path)
        z, w = z.copy(), np.empty_like(x)
        force_for(x, path[0], self.block.loop, z, w)
        return w0 + w, (w0, path, z)

    def c_form(self, ahead: int) -> CForm:
        rest = "memset(s, 0, sizeof *s);\ns->w0 = x;\ns->x0 = ME_path_rest(&s->path, settle(x, k2, k3));\nreturn x;"
        numbers = dict(zip(("m1", "m2", "k2", "k3"), self.block.loop.tolist(), strict=True))
        state = ("double w0, x0", "double z[2]")
        return CForm(FORCE_FOR, rest, numbers, state, (FORCE, SETTLE), {"path": self.path.c_form()})


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


def at_time(step: str, block: TimeBlock, ahead: int) -> CForm | str:
    """C form that calls the forward function of a block as part `forward`, `ahead` samples later."""
    forward = block.c_form()
    if isinstance(forward, str):
        return forward
    rest = "ME_forward_rest(&s->forward, x);\ns->forward.count = ahead;\nreturn x;"
    return CForm(step, rest, {"ahead": float(ahead)}, parts={"forward": forward})


class InvertedGainDrift(InvertedBlock):
    """y = x · g(t)."""

    def __init__(self, block: GainDriftBlock) -> None:
        self.block = block

    def run(self, y: Array, state: State, time: Array) -> tuple[Array, State]:
        return y / self.block.slope(y, time), None

    def c_form(self, ahead: int) -> CForm | str:
        return at_time("return x / ME_forward_step(&s->forward, 1.0);", self.block, ahead)


class InvertedAddition(InvertedBlock):
    """y = x + d(t)."""

    def __init__(self, block: TimeBlock) -> None:
        self.block = block

    def run(self, y: Array, state: State, time: Array) -> tuple[Array, State]:
        return y - self.block.value(np.zeros_like(y), time), None

    def c_form(self, ahead: int) -> CForm | str:
        return at_time("return x - ME_forward_step(&s->forward, 0.0);", self.block, ahead)


class InvertedOffset(InvertedBlock):
    """y = x + y0 + r x_rest."""

    def __init__(self, block: OffsetBlock) -> None:
        self.block = block

    def start(self, x0: float, state: State) -> State:
        return state

    def run(self, y: Array, state: State, time: Array) -> tuple[Array, State]:
        return y - (self.block.y0 + self.block.settling * state), state

    def c_form(self, ahead: int) -> CForm:
        numbers = {"y0": self.block.y0, "settling": self.block.settling}
        step, rest = "return x - (y0 + settling * s->x_rest);", "s->x_rest = x;\nreturn x;"
        return CForm(step, rest, numbers, ("double x_rest",))
