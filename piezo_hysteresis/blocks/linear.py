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

"""`LinearBlock`: linear dynamics around the rest point, alone or in parallel with a direct path."""

from __future__ import annotations

from abc import abstractmethod

import numpy as np

from .block import Array, Block, State, extended
from .kernel import kernel


@kernel
def add_mixed(weights, rows, out):
    """out (j, n) += Σ_k weights (k, j) · rows (k, n); a matrix product that does not depend on how n is cut."""
    for j in range(out.shape[0]):
        for k in range(rows.shape[0]):
            for i in range(rows.shape[1]):
                out[j, i] += weights[k, j] * rows[k, i]


class LinearBlock(Block):
    """Linear dynamics acting on the deviation from the rest point: y = K·x0 + filter(x − x0).

    At rest the filter state is exactly zero, so a stage at rest does not drift by rounding.
    """

    gain: float = 1.0

    @abstractmethod
    def zeros(self, rows: int) -> Array:
        """Filter state of `rows` parallel signals at rest, shape (rows, s)."""

    @abstractmethod
    def filter(self, x: Array, z: Array, y: Array) -> Array:
        """Filter `rows` signals x (rows, n) from state z (rows, s) to y (rows, n); returns a new state."""

    @abstractmethod
    def own_rest(self) -> State:
        """Tangent state of the own parameters at rest."""

    @abstractmethod
    def by_parameter(self, x: Array, y: Array, z: Array, own: State, rows: Array) -> State:
        """∂ filter/∂θ to rows (p, n), for deviations x, outputs y (both (n,)), state z (s,) before the block."""

    def gain_slopes(self) -> Array:
        """∂K/∂θ, shape (p,)."""
        return np.zeros(len(self.names))

    def static(self, x0: float) -> float:
        return self.gain * x0

    def static_slopes(self, x0: float) -> tuple[float, Array]:
        return self.gain, self.gain_slopes() * x0

    def rest(self, x0: float, time: float) -> State:
        return x0, self.zeros(1)

    def run(self, x: Array, state: State) -> tuple[Array, State]:
        x0, z = state
        y = np.empty((1, x.size))
        z = self.filter((x - x0)[None, :], z, y)
        return self.gain * x0 + y[0], (x0, z)

    def rest_tangent(self, x0: float, dx0: Array) -> State:
        return np.array(dx0), self.zeros(len(dx0)), self.own_rest()

    def linearise(self, x: Array, dx: Array, state: State, tangent: State) -> tuple[Array, Array, State, State]:
        m, rows = len(dx), extended(dx, len(self.names))
        outputs, state, tangent = self._respond(x, dx, state, tangent, rows[m:])
        rows[:m] = outputs[1:]
        return outputs[0], rows, state, tangent

    def _respond(
        self, x: Array, dx: Array, state: State, tangent: State, own_rows: Array
    ) -> tuple[Array, State, State]:
        """K·x0 + filter(x − x0) of x and of the rows dx, (1 + m, n), and the states; `own_rows` (p, n) are filled."""
        x0, z = state
        dx0, dz, own = tangent
        both = np.vstack((x - x0, dx - dx0[:, None] if dx0.any() else dx))
        outputs = np.empty_like(both)
        z_next = self.filter(both, np.vstack((z, dz)), outputs)
        own = self.by_parameter(both[0], outputs[0], z[0], own, own_rows)
        settled, own_settled = self.gain * np.append(x0, dx0), self.gain_slopes() * x0
        if settled.any():  # not where the drive began at 0 V, as most do
            outputs += settled[:, None]
        if own_settled.any():
            own_rows += own_settled[:, None]
        return outputs, (x0, z_next[:1]), (dx0, z_next[1:], own)


class AddedBlock(LinearBlock):
    """A direct path with linear dynamics in parallel: y = x + K·x0 + filter(x − x0).

    The addition of zero does not change x, so effects in this form are exactly absent if they are off.
    """

    gain = 0.0

    @property
    def is_idle(self) -> bool:
        """True if `filter` gives zero for every input, so that incoming sensitivities are not changed."""
        return False

    def static(self, x0: float) -> float:
        return x0 + self.gain * x0

    def static_slopes(self, x0: float) -> tuple[float, Array]:
        return 1.0 + self.gain, self.gain_slopes() * x0

    def run(self, x: Array, state: State) -> tuple[Array, State]:
        added, state = super().run(x, state)
        return x + added, state

    def linearise(self, x: Array, dx: Array, state: State, tangent: State) -> tuple[Array, Array, State, State]:
        if self.is_idle:
            return self._linearise_idle(x, dx, state, tangent)
        m, rows = len(dx), extended(dx, len(self.names))
        added, state, tangent = self._respond(x, dx, state, tangent, rows[m:])
        rows[:m] += added[1:]
        return x + added[0], rows, state, tangent

    def _linearise_idle(self, x: Array, dx: Array, state: State, tangent: State) -> tuple[Array, Array, State, State]:
        x0, z = state
        dx0, dz, own = tangent
        m, y, rows = len(dx), np.empty((1, x.size)), extended(dx, len(self.names))
        z_next = self.filter((x - x0)[None, :], z, y)
        own = self.by_parameter(x - x0, y[0], z[0], own, rows[m:])
        rows[m:] += (self.gain_slopes() * x0)[:, None]
        return x, rows, (x0, z_next), (dx0, dz, own)
