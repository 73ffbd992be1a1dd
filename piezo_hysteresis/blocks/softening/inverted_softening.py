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

"""`InvertedSoftening`: inverse of a softened mode that drives the rest of G."""

from __future__ import annotations

import numpy as np

from ...c_form import CForm
from ..block import Array, State
from ..inverses.inverted_block import InvertedBlock
from ..inverses.linear_inverse import LinearInverse
from ..kernel import kernel
from .softened_arx_c import FORCE, FORCE_FOR, SETTLE
from .stiffness import StaticSoftening, force


@kernel
def force_for(x, x0, p, z, w):
    """w (n,) − w0 for a motion x (n,) of the mode; p = [m1, m2, k2, k3]; z, the last two deflections, is updated."""
    gain, held = 1.0 + p[0] + p[1], force(x0, p[2], p[3])
    for i in range(x.size):
        moved = x[i] - x0
        w[i] = (moved + p[0] * z[0] + p[1] * z[1]) / gain + (force(x0 + z[0], p[2], p[3]) - held)
        z[1], z[0] = z[0], moved


class InvertedSoftening(InvertedBlock):
    """Inverse of a softened mode that drives the rest of G: first the rest, then the force on the mode.

    It starts settled.
    """

    def __init__(self, settled: StaticSoftening, loop: Array, path: LinearInverse) -> None:
        self.settled, self.loop, self.path = settled, loop, path
        self.preview, self.is_exact, self.noise_gain = path.preview, path.is_exact, path.noise_gain

    def start(self, x0: float, state: State, ahead: int) -> State:
        settled = self.settled.static(x0)
        return x0, self.path.rest(settled), np.zeros(2)

    def run(self, y: Array, state: State, time: Array) -> tuple[Array, State]:
        w0, path, z = state
        x, path = self.path.run(y, path)
        z, w = z.copy(), np.empty_like(x)
        force_for(x, path[0], self.loop, z, w)
        return w0 + w, (w0, path, z)

    def c_form(self, ahead: int) -> CForm:
        rest = "memset(s, 0, sizeof *s);\ns->w0 = x;\ns->x0 = ME_path_rest(&s->path, settle(x, k2, k3));\nreturn x;"
        numbers = dict(zip(("m1", "m2", "k2", "k3"), self.loop.tolist(), strict=True))
        state = ("double w0, x0", "double z[2]")
        return CForm(FORCE_FOR, rest, numbers, state, (FORCE, SETTLE), {"path": self.path.c_form()})
