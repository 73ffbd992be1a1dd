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

"""The ARX with a dominant mode whose stiffness changes with deflection.

G has a dominant mode M = g/(1 + m1 z⁻¹ + m2 z⁻²), g = 1 + m1 + m2. With the force N(x) = k2 |x| x + k3 x³ its modal
coordinate is x_i = −m1 x_(i−1) − m2 x_(i−2) + g (w_i − N(x_(i−1))). Its deviation ξ from the linear mode passes through
R and is added to the output of the unchanged ARX: y = G w + R ξ. If the effect is off, ξ is exactly zero. R is the path
from the mode to the sensor: the rest of G, R = G/M, or the share of the mode in a sum of modes.
"""

from __future__ import annotations

import numpy as np

from ...c_form import CForm
from ..arx import ArxBlock
from ..block import Array, Block, MemorylessBlock, State, extended
from ..group_delay import GroupDelayBlock
from ..inverses.inverted_block import InvertedBlock
from ..inverses.linear_inverse import LinearInverse
from ..kernel import kernel
from ..linear import add_mixed
from .inverted_softening import InvertedSoftening
from .mode_path import Path, WholePath
from .series import SeriesBlock
from .softened_arx_c import FORCE, REST, SETTLE, STEP
from .stiffness import StaticSoftening, force, force_slope


@kernel
def run_mode_deviation(w, x0, p, z, xi):
    """ξ (n,) for w (n,) relative to rest at x0; p = [m1, m2, k2, k3]; z = linear mode, ξ, two samples each."""
    gain, held = 1.0 + p[0] + p[1], force(x0, p[2], p[3])
    for i in range(w.size):
        excess = force(x0 + (z[0] + z[2]), p[2], p[3]) - held
        mode = gain * w[i] - p[0] * z[0] - p[1] * z[1]
        xi[i] = -p[0] * z[2] - p[1] * z[3] - gain * excess
        z[1], z[0], z[3], z[2] = z[0], mode, z[2], xi[i]


@kernel
def linearise_mode_deviation(w, dw, x0, dx0, p, z, dz, xi, dxi):
    """`run_mode_deviation` with ∂ξ to dxi (m + 4, n): rows dw (m, n), then p.

    dx0 (m + 4,) are the sensitivities of x0; dz (m + 4, 4) is updated.
    """
    gain, m, n = 1.0 + p[0] + p[1], dw.shape[0], w.size
    m1, m2 = p[0], p[1]
    held, held_slope = force(x0, p[2], p[3]), force_slope(x0, p[2], p[3])
    slope, forcing = np.empty(n), np.zeros((4, 2, n))
    for i in range(n):
        x = x0 + (z[0] + z[2])
        excess = force(x, p[2], p[3]) - held
        slope[i] = force_slope(x, p[2], p[3])
        forcing[0, 0, i], forcing[0, 1, i] = w[i] - z[0], -z[2] - excess
        forcing[1, 0, i], forcing[1, 1, i] = w[i] - z[1], -z[3] - excess
        forcing[2, 1, i] = -gain * (abs(x) * x - abs(x0) * x0)
        forcing[3, 1, i] = -gain * (x * x * x - x0 * x0 * x0)
        xi[i] = -m1 * z[2] - m2 * z[3] - gain * excess
        z[1], z[0], z[3], z[2] = z[0], gain * w[i] - m1 * z[0] - m2 * z[1], z[2], xi[i]
    for r in range(m + 4):
        mode, mode_before, moved, moved_before = dz[r, 0], dz[r, 1], dz[r, 2], dz[r, 3]
        for i in range(n):
            d_excess = slope[i] * (dx0[r] + mode + moved) - held_slope * dx0[r]
            d_mode = -m1 * mode - m2 * mode_before
            d_xi = -m1 * moved - m2 * moved_before - gain * d_excess
            if r < m:
                d_mode += gain * dw[r, i]
            else:
                d_mode += forcing[r - m, 0, i]
                d_xi += forcing[r - m, 1, i]
            mode, mode_before, moved, moved_before = d_mode, mode, d_xi, moved
            dxi[r, i] = d_xi
        dz[r, 0], dz[r, 1], dz[r, 2], dz[r, 3] = mode, mode_before, moved, moved_before


class SoftenedArxBlock(Block):
    """State: state of the ARX; w and x at rest; states of mode and ξ; state of the path.

    If the softening is off, ξ has no incoming sensitivities: those of the ARX are left, and those by k2 and k3.
    """

    def __init__(self, arx: ArxBlock, settled: StaticSoftening, path: Path) -> None:
        self.arx, self.settled, self.path = arx, settled, path
        self.loop = np.append(path.mode, (settled.k2, settled.k3))
        self.names = (*settled.names, *arx.names)
        self.is_off = settled.k2 == settled.k3 == 0.0

    def static(self, x0: float) -> float:
        return self.arx.gain * x0 + self.path.share * (self.settled.static(x0) - x0)

    def static_slopes(self, x0: float) -> tuple[float, Array]:
        slope, own = self.settled.static_slopes(x0)
        by_arx = self.arx.gain_slopes() * x0 + self.path.share_slopes * (self.settled.static(x0) - x0)
        return self.arx.gain + self.path.share * (slope - 1.0), np.concatenate((self.path.share * own, by_arx))

    def rest(self, x0: float, time: float) -> State:
        return self.arx.rest(x0, time), (x0, self.settled.static(x0)), np.zeros(4), self.path.filter.zeros(1)

    def run(self, x: Array, state: State) -> tuple[Array, State]:
        arx, (w0, x0), z, filtered = state
        y, arx = self.arx.run(x, arx)
        xi, z = np.empty(x.shape), z.copy()
        run_mode_deviation(x - w0, x0, self.loop, z, xi)
        added = np.empty((1, x.size))
        filtered = self.path.filter.filter(xi[None, :], filtered, added)
        return y + (self.path.share * (x0 - w0) + added[0]), (arx, (w0, x0), z, filtered)

    def c_form(self) -> CForm:
        numbers = dict(zip(("m1", "m2", "k2", "k3"), self.loop.tolist(), strict=True)) | {"share": self.path.share}
        state = ("double w0, x0", "double mode[2]", "double xi[2]")
        parts = {"linear": self.arx.c_form(), "path": self.path.filter.c_form()}
        return CForm(STEP, REST, numbers, state, (FORCE, SETTLE), parts)

    def inverted(self, name: str) -> InvertedBlock | None:
        if not isinstance(self.path, WholePath):
            return super().inverted(name)
        path = LinearInverse(self.path.filter.sections()[0], self.arx.gain, name)
        return InvertedSoftening(self.settled, self.loop, path)

    def rest_tangent(self, x0: float, dx0: Array) -> State:
        slope, own = self.settled.static_slopes(x0)
        dw0 = np.array(dx0[:0] if self.is_off else dx0)
        settled = np.concatenate((slope * dw0, np.zeros(2), own))
        moved = np.zeros((len(settled), 4))
        filtered = self.path.filter.zeros(len(settled))
        return self.arx.rest_tangent(x0, dx0), dw0, settled, moved, filtered, self.path.filter.own_rest()

    def linearise(self, x: Array, dx: Array, state: State, tangent: State) -> tuple[Array, Array, State, State]:
        arx, (w0, x0), z, filtered = state
        d_arx, dw0, dx0, dz, d_filtered, own = tangent
        m, moved, path = len(dx), len(dw0), self.path
        d_xi, dz, xi, z = np.empty((moved + 4, x.size)), dz.copy(), np.empty(x.shape), z.copy()
        linearise_mode_deviation(x - w0, dx[:moved] - dw0[:, None], x0, dx0, self.loop, z, dz, xi, d_xi)
        y, rows, arx, d_arx = self.arx.linearise(x, dx, arx, d_arx)
        through = np.empty(d_xi.shape)
        d_filtered = path.filter.filter(d_xi, d_filtered, through)
        through += path.share * (dx0 - np.pad(dw0, (0, 4)))[:, None]
        if not self.is_off:
            rows[:m] += through[:m]
            added, by_path = np.empty((1, x.size)), np.empty((len(path.by_a) + 1, x.size))
            after = path.filter.filter(xi[None, :], filtered, added)
            own = path.filter.by_parameter(xi, added[0], filtered[0], own, by_path)
            self._add_by_arx(added, through[m : m + 2], by_path, rows[m:])
            rows[m:] += (path.share_slopes * (x0 - w0))[:, None]
            y, filtered = y + (path.share * (x0 - w0) + added[0]), after
        rows = extended(rows, 2)
        rows[m + 2 :] = rows[m:-2]
        rows[m : m + 2] = through[moved + 2 :]
        return y, rows, (arx, (w0, x0), z, filtered), (d_arx, dw0, dx0, dz, d_filtered, own)

    def _add_by_arx(self, added: Array, by_mode: Array, by_path: Array, rows: Array) -> None:
        """Add the derivatives of R ξ (1, n), by mode (2, n) and path (k + 1, n), to the rows of the ARX (p, n)."""
        na, nb = self.arx.a.size, self.arx.b.size
        add_mixed(self.path.mode_by_a, by_mode - added / self.path.gain, rows[:na])
        add_mixed(self.path.by_a, by_path[:-1], rows[:na])
        add_mixed(self.path.by_b, by_path[:-1], rows[na : na + nb])
        rows[na + nb] += by_path[-1]


class SlowSoftenedBlock(SeriesBlock):
    """Static softening of one mode in a sum, followed by the lag of G, for records slower than the model.

    The rows of the series are those of the stiffness, the ratio and the ARX; the ratio is a function of the ARX.
    """

    def __init__(self, lag: GroupDelayBlock, arx: ArxBlock, settled: StaticSoftening, path: Path) -> None:
        ratio = path.share / arx.gain
        super().__init__((_Shared(settled, ratio), lag))
        self.ratio_slopes = (path.share_slopes - ratio * arx.gain_slopes()) / arx.gain
        self.names = (*settled.names, *lag.names)

    def static_slopes(self, x0: float) -> tuple[float, Array]:
        slope, own = super().static_slopes(x0)
        return slope, np.concatenate((own[:2], own[3:] + self.ratio_slopes * own[2]))

    def linearise(self, x: Array, dx: Array, state: State, tangent: State) -> tuple[Array, Array, State, State]:
        y, rows, state, tangent = super().linearise(x, dx, state, tangent)
        own = rows[len(dx) :]
        add_mixed(self.ratio_slopes[None, :], own[2:3], own[3:])
        own[2:-1] = own[3:]
        return y, rows[:-1], state, tangent


class _Shared(MemorylessBlock):
    """w + ratio (x − w)."""

    def __init__(self, settled: StaticSoftening, ratio: float) -> None:
        self.settled, self.ratio, self.names = settled, ratio, (*settled.names, "ratio")

    def value(self, x: Array) -> Array:
        return x + self.ratio * (self.settled.value(x) - x)

    def slope(self, x: Array) -> Array:
        return 1.0 + self.ratio * (self.settled.slope(x) - 1.0)

    def by_parameter(self, x: Array) -> Array:
        return np.vstack((self.ratio * self.settled.by_parameter(x), self.settled.value(x) - x))
