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

"""First-order relaxation τ ẋ + x = u, stepped exactly for an input that is linear between samples."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..c_form import CForm, Number
from ..inverse_terms import InverseStart, InverseTerms, RelaxationTerms
from .block import Array, State, extended
from .kernel import kernel
from .linear import AddedBlock

LANES = 4
"""Number of elements that are computed together; the elements are padded to a multiple of it."""

TILE = 256
"""Number of samples of all rows that are processed together, so that they stay in the processor's cache."""

MANY = 5
"""Number of rows from which it is faster to compute them side by side."""


class Hold(NamedTuple):
    """Step x_i = x_(i−1) + fade·(u_(i−1) − x_(i−1)) + lead·(u_i − u_(i−1)), each (s,), and its derivatives by τ."""

    fade: Array
    lead: Array
    fade_slope: Array
    lead_slope: Array


def hold(tau: Array, sample_period: float) -> Hold:
    """Coefficients for time constants `tau` [s], zero or more, shape (s,).

    The lag near dc is τ at every sample period; τ = 0 gives x = u.

    >>> [round(float(c[0]), 6) for c in hold(np.array([1.0]), 1.0)[:2]]
    [0.632121, 0.367879]
    >>> [float(c[0]) for c in hold(np.array([0.0]), 1.0)[:2]]
    [1.0, 1.0]
    """
    x = sample_period / np.maximum(tau, sample_period / 1000.0)  # e^(−1000) is zero in double precision
    left, fade = np.exp(-x), -np.expm1(-x)
    fade_slope = -x * x * left / sample_period
    return Hold(fade, 1.0 - fade * tau / sample_period, fade_slope, (x * left - fade) / sample_period)


@kernel
def relax(u, fade, lead, weights, z, y):
    """Rows of u (r, n) to sums y (q, r, n) = Σ_j weights_kj x_j; z (r, 1 + s) = last input and x_j, updated.

    weights (q, s), with s a multiple of 4: so many relaxations are computed together, because each sample of a single
    one depends on the sample before.
    """
    n = u.shape[1]
    y[:] = 0.0
    for r in range(u.shape[0]):
        for j in range(0, fade.size, LANES):
            f0, f1, f2, f3 = fade[j], fade[j + 1], fade[j + 2], fade[j + 3]
            l0, l1, l2, l3 = lead[j], lead[j + 1], lead[j + 2], lead[j + 3]
            x0, x1, x2, x3 = z[r, j + 1], z[r, j + 2], z[r, j + 3], z[r, j + 4]
            last = z[r, 0]
            for i in range(n):
                du = u[r, i] - last
                x0 += f0 * (last - x0) + l0 * du
                x1 += f1 * (last - x1) + l1 * du
                x2 += f2 * (last - x2) + l2 * du
                x3 += f3 * (last - x3) + l3 * du
                last = u[r, i]
                for k in range(weights.shape[0]):
                    w = weights[k]
                    y[k, r, i] += (w[j] * x0 + w[j + 1] * x1) + (w[j + 2] * x2 + w[j + 3] * x3)
            z[r, j + 1], z[r, j + 2], z[r, j + 3], z[r, j + 4] = x0, x1, x2, x3
        z[r, 0] = u[r, n - 1]


@kernel
def relax_side_by_side(u, fade, lead, weights, z, y):
    """`relax` to one sum (r, n) with the same bits, but three times as fast for many rows: none waits for the others.

    The rows are padded to a multiple of 8, and to 16, because so many are computed at a time.
    """
    rows, n = u.shape
    width = max(16, rows + -rows % 8)
    inputs, totals, x = np.zeros((TILE + 1, width)), np.empty((TILE, width)), np.zeros((LANES, width))
    z0, z1, z2, z3 = x[0], x[1], x[2], x[3]
    for start in range(0, n, TILE):
        size = min(TILE, n - start)
        for r in range(rows):
            inputs[0, r] = z[r, 0]
            for i in range(size):
                inputs[i + 1, r] = u[r, start + i]
        totals[:] = 0.0
        for j in range(0, fade.size, LANES):
            f0, f1, f2, f3 = fade[j], fade[j + 1], fade[j + 2], fade[j + 3]
            l0, l1, l2, l3 = lead[j], lead[j + 1], lead[j + 2], lead[j + 3]
            w0, w1, w2, w3 = weights[j], weights[j + 1], weights[j + 2], weights[j + 3]
            near = z[:, j + 1 : j + 1 + LANES].T
            x[:, :rows] = near
            for i in range(size):
                before, now, total = inputs[i], inputs[i + 1], totals[i]
                for r in range(width):
                    last, du = before[r], now[r] - before[r]
                    x0 = z0[r] + (f0 * (last - z0[r]) + l0 * du)
                    x1 = z1[r] + (f1 * (last - z1[r]) + l1 * du)
                    x2 = z2[r] + (f2 * (last - z2[r]) + l2 * du)
                    x3 = z3[r] + (f3 * (last - z3[r]) + l3 * du)
                    z0[r], z1[r], z2[r], z3[r] = x0, x1, x2, x3
                    total[r] += (w0 * x0 + w1 * x1) + (w2 * x2 + w3 * x3)
            near[:] = x[:, :rows]
        for r in range(rows):
            z[r, 0] = inputs[size, r]
            for i in range(size):
                y[r, start + i] = totals[i, r]


STEP = """\
const double u = x - s->x_rest, du = u - s->last;
double y = 0.0;
int j;
for (j = 0; j < SIZE; j++) {
    s->z[j] += fade[j] * (s->last - s->z[j]) + lead[j] * du;
}
for (j = 0; j < SIZE; j += 4) {
    y += (weight[j] * s->z[j] + weight[j + 1] * s->z[j + 1])
       + (weight[j + 2] * s->z[j + 2] + weight[j + 3] * s->z[j + 3]);
}
s->last = u;
return x + (gain * s->x_rest + (y + direct * u));
"""
"""C code of `relax` for one sample."""


class RelaxationBlock(AddedBlock):
    """y = x + direct·x + Σ weight_j x_j, with x_j the relaxation of x with τ_j.

    Parameters
    ----------
    names : tuple of str
        Parameters on which `direct` and the weights depend.
    tau : (s,) ndarray
        Time constants [s].
    sample_period : float
        Sample period [s].
    mix : (1 + s,) ndarray
        `direct`, then the weights.
    mix_slopes : (p, 1 + s) ndarray
        Their derivatives by the parameters.
    """

    keeps_state = True

    def __init__(self, names: tuple[str, ...], tau: Array, sample_period: float, mix: Array, mix_slopes: Array) -> None:
        idle = -tau.size % LANES
        self.names = names
        self.mix = np.pad(mix, (0, idle))
        self.mix_slopes = np.pad(mix_slopes, ((0, 0), (0, idle)))
        self.hold = hold(np.pad(tau, (0, idle), mode="edge"), sample_period)
        self.gain = float(mix.sum())

    @property
    def is_idle(self) -> bool:
        return not self.mix.any()

    def zeros(self, rows: int) -> Array:
        return np.zeros((rows, self.mix.size))

    def filter(self, x: Array, z: Array, y: Array) -> Array:
        z, weights = z.copy(), self.mix[1:].copy()
        if len(x) < MANY:
            relax(x, self.hold.fade, self.hold.lead, weights[None, :], z, y[None, :])
        else:
            relax_side_by_side(x, self.hold.fade, self.hold.lead, weights, z, y)
        y += self.mix[0] * x
        return z

    def c_form(self) -> CForm:
        numbers: dict[str, Number] = {
            "SIZE": self.mix.size - 1,
            "fade": self.hold.fade,
            "lead": self.hold.lead,
            "gain": self.gain,
        }
        numbers |= {"direct": float(self.mix[0]), "weight": self.mix[1:]}
        state = ("double x_rest, last", f"double z[{self.mix.size - 1}]")
        return CForm(STEP, "memset(s, 0, sizeof *s);\ns->x_rest = x;\nreturn x + gain * x;", numbers, state)

    def inverse_terms(self) -> InverseTerms:
        direct, weights = float(self.mix[0]), self.mix[1:]
        own = RelaxationTerms(direct, self.hold.fade, self.hold.lead, weights, self.gain)
        return InverseTerms(relaxations=own)

    def inverse_start(self, x: float, state: State) -> InverseStart:
        x0, z = state
        return InverseStart(relaxations=(x0 + z[0, 0], x0 + z[0, 1:]))

    def gain_slopes(self) -> Array:
        return self.mix_slopes.sum(axis=1)

    def own_rest(self) -> None:
        return None

    def by_parameter(self, x: Array, y: Array, z: Array, own: None, rows: Array) -> None:
        self._by_mix(x, z[None, :].copy(), rows)

    def _by_mix(self, x: Array, z: Array, rows: Array) -> None:
        relax(x[None, :], self.hold.fade, self.hold.lead, self.mix_slopes[:, 1:].copy(), z, rows[:, None, :])
        rows += np.multiply.outer(self.mix_slopes[:, 0], x)

    def _linearise_idle(self, x: Array, dx: Array, state: State, tangent: State) -> tuple[Array, Array, State, State]:
        x0, z = state[0], state[1].copy()
        rows = extended(dx, len(self.names))
        own = rows[len(dx) :]
        self._by_mix(x - x0, z, own)  # the state is that of the own rows
        own += (self.gain_slopes() * x0)[:, None]
        return x, rows, (x0, z), tangent
