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

"""`ArxBlock`: the difference equation of the ARX at the model's own sample period."""

from __future__ import annotations

import numpy as np

from ..c_form import HISTORY, CForm
from .block import Array, Section, State, extended
from .kernel import fma, kernel
from .linear import LinearBlock

ORDER = 8
"""Taps and feedback are padded with zeros to multiples of this number, because eight numbers fit into registers."""

TILE = 1024
"""Number of samples that are processed together, so that they stay in the first-level cache."""


def lagrange(fraction: float) -> tuple[Array, Array]:
    """Third-order interpolation at delay 1 + fraction over taps 0 … 3, and its derivative, each shape (4,).

    >>> lagrange(0.0)[0].tolist()
    [0.0, 1.0, 0.0, 0.0]
    """
    t0 = 1.0 + fraction
    t1, t2, t3 = fraction, fraction - 1.0, fraction - 2.0
    scale = np.array([-6.0, 2.0, -2.0, 6.0])
    taps = np.array([t1 * t2 * t3, t0 * t2 * t3, t0 * t1 * t3, t0 * t1 * t2]) / scale
    by_others = [t2 * t3 + t1 * t3 + t1 * t2, t2 * t3 + t0 * t3 + t0 * t2]
    by_others += [t1 * t3 + t0 * t3 + t0 * t1, t1 * t2 + t0 * t2 + t0 * t1]
    return taps + 0.0, np.array(by_others) / scale


def padded(coefficients: Array) -> Array:
    """Coefficients padded with zeros to a multiple of `ORDER`."""
    return np.pad(coefficients, (0, -coefficients.size % ORDER))


@kernel
def weigh(x, taps, y):
    """y_i = Σ_k taps_k x_(i + K − k) with K + 1 taps, a multiple of `ORDER`; x (n + K,), y (n,)."""
    for k in range(0, taps.size, 8):
        t0, t1, t2, t3 = taps[k], taps[k + 1], taps[k + 2], taps[k + 3]
        t4, t5, t6, t7 = taps[k + 4], taps[k + 5], taps[k + 6], taps[k + 7]
        past = x[taps.size - 8 - k :]  # indices from zero avoid the check for negative indices
        for i in range(y.size):
            total = y[i] if k else 0.0
            total = fma(t7, past[i], total)
            total = fma(t6, past[i + 1], total)
            total = fma(t5, past[i + 2], total)
            total = fma(t4, past[i + 3], total)
            total = fma(t3, past[i + 4], total)
            total = fma(t2, past[i + 5], total)
            total = fma(t1, past[i + 6], total)
            y[i] = fma(t0, past[i + 7], total)


@kernel
def recur(a, z, x, y0, y):
    """y_i = y0 + s_i with s_i = x_i − Σ_k a_k s_(i − k); z (a.size,) = s before, newest first, updated.

    a has `ORDER` coefficients or more; x and y may be the same.
    """
    a1, a2, a3, a4, a5, a6, a7, a8 = a[0], a[1], a[2], a[3], a[4], a[5], a[6], a[7]
    y1, y2, y3, y4, y5, y6, y7, y8 = z[0], z[1], z[2], z[3], z[4], z[5], z[6], z[7]
    for i in range(y.size):
        total = x[i]
        for k in range(a.size - 1, 7, -1):
            total = fma(-a[k], z[k], total)
        # the newest output is used last, so that the other products need not wait for it
        total = fma(-a8, y8, total)
        total = fma(-a7, y7, total)
        total = fma(-a6, y6, total)
        total = fma(-a5, y5, total)
        total = fma(-a4, y4, total)
        total = fma(-a3, y3, total)
        total = fma(-a2, y2, total)
        total = fma(-a1, y1, total)
        if a.size > 8:
            for k in range(a.size - 1, 8, -1):
                z[k] = z[k - 1]
            z[8] = y8
        y8, y7, y6, y5, y4, y3, y2, y1 = y7, y6, y5, y4, y3, y2, y1, total
        y[i] = y0 + total
    z[0], z[1], z[2], z[3], z[4], z[5], z[6], z[7] = y1, y2, y3, y4, y5, y6, y7, y8


@kernel
def arx_row(x, x0, y0, taps, offset, a, z, y):
    """y (n,) = y0 + x (n,) − x0 through taps delayed by offset and 1/A; z (inputs + a.size,) is updated."""
    inputs = offset + taps.size - 1
    held, weighted = np.empty(inputs + min(TILE, x.size)), np.empty(min(TILE, x.size))
    held[:inputs] = z[:inputs]
    for start in range(0, x.size, TILE):
        near, out = x[start : start + TILE], y[start : start + TILE]
        n = near.size
        for i in range(n):
            held[inputs + i] = near[i] - x0
        weigh(held[: inputs + n - offset], taps, weighted[:n])
        if a.size:
            recur(a, z[inputs:], weighted[:n], y0, out)
        else:
            out[:] = y0 + weighted[:n]
        for i in range(inputs):
            held[i] = held[n + i]
    z[:inputs] = held[:inputs]


@kernel
def arx_filter(x, x0, y0, taps, offset, a, z, y):
    """`arx_row` for rows of x (r, n), rest values x0 (r,) and y0 (r,), states z (r, inputs + a.size), y (r, n).

    x and y may be the same.
    """
    for r in range(x.shape[0]):
        arx_row(x[r], x0[r], y0[r], taps, offset, a, z[r], y[r])


@kernel
def arx_slopes(x, y, at_rest, taps_slope, first, a, interpolation, na, poles, before_x, before_y, rows):
    """Rows ∂y/∂a, ∂y/∂b, ∂y/∂d (na + nb + 1, n) of deviations x and y (n,), to which `at_rest` is added.

    They are x/A and y/A at many delays. poles (2, a.size) are the states of these filters, before_x (first +
    taps_slope.size − 1,) and before_y (na,) their last outputs; all are updated.
    """
    n, past_x, nb = x.size, before_x.size, rows.shape[0] - na - 1
    by_x, by_y = np.empty(past_x + n), np.empty(na + n)
    by_x[:past_x], by_x[past_x:] = before_x, x
    by_y[:na], by_y[na:] = before_y, y
    if a.size:
        recur(a, poles[0], by_x[past_x:], 0.0, by_x[past_x:])
        recur(a, poles[1], by_y[na:], 0.0, by_y[na:])
    for j in range(na):
        past, rest = by_y[na - 1 - j :], at_rest[j]
        for i in range(n):
            rows[j, i] = rest - past[i]
    for j in range(nb):
        past, row, rest = by_x[taps_slope.size - 4 - j :], rows[na + j], at_rest[na + j]
        i0, i1, i2, i3 = interpolation[0], interpolation[1], interpolation[2], interpolation[3]
        for i in range(n):
            row[i] = rest + ((i0 * past[i + 3] + i1 * past[i + 2]) + (i2 * past[i + 1] + i3 * past[i]))
    weigh(by_x[: by_x.size - first], taps_slope, rows[na + nb])
    before_x[:], before_y[:] = by_x[n:], by_y[n:]


def dc_gain_slopes(a: Array, b: Array) -> Array:
    """∂G(1) by a_1 … a_na, b_1 … b_nb and the delay, shape (na + nb + 1,)."""
    at_a = 1.0 + a.sum()
    return np.concatenate((np.full(a.size, -b.sum() / at_a**2), np.full(b.size, 1.0 / at_a), [0.0]))


INPUTS = """\
const double *u = remember(s->inputs, INPUTS, &s->newest_input, x - s->x_rest) + OFFSET;
double y = 0.0;
int i, k;
for (i = 0; i < TAPS; i += 8) {
    for (k = (i + 8 < TAPS ? i + 8 : TAPS) - 1; k >= i; k--) {
        y = FMA(b[k], u[k], y);
    }
}
"""
"""C code of `weigh` for one sample."""
FEEDBACK = """\
for (k = ORDER - 1; k >= 0; k--) {
    y = FMA(-a[k], s->outputs[s->newest_output + k], y);
}
remember(s->outputs, ORDER, &s->newest_output, y);
"""
"""C code of `recur` for one sample."""


def difference_equation(taps: Array, offset: int, feedback: Array, rest: str, **numbers: float) -> CForm:
    """`arx_row` as C code, without zeros at the end of taps and feedback.

    `rest` is C code that sets ``s->x_rest`` and ``s->y_rest`` for x, using `numbers`, and returns the output.
    """
    b, a = np.trim_zeros(taps, "b") if taps.any() else taps[:1], np.trim_zeros(feedback, "b")
    state = ["double x_rest, y_rest", f"double inputs[{2 * (offset + b.size)}]", "int newest_input"]
    counts = {"INPUTS": offset + b.size, "OFFSET": offset, "TAPS": b.size}
    if a.size:
        state += [f"double outputs[{2 * a.size}]", "int newest_output"]
    step = INPUTS + (FEEDBACK if a.size else "") + "return s->y_rest + y;"
    start = f"memset(s, 0, sizeof *s);\n{rest}"
    return CForm(step, start, {**counts, "ORDER": a.size, "b": b, "a": a, **numbers}, tuple(state), (HISTORY,))


class ArxBlock(LinearBlock):
    """State: history of inputs, oldest first, and of outputs, newest first."""

    def __init__(self, names: tuple[str, ...], a: Array, b: Array, delay: float) -> None:
        self.names, self.a, self.b = names, a, b
        self.gain = b.sum() / (1.0 + a.sum())
        whole = max(1, int(delay))  # below one sample the first interval of the taps is interpolated
        self.interpolation, slopes = lagrange(delay - whole)
        self.first = whole - 1
        exact = delay == whole
        self.offset = whole if exact else self.first
        self.taps = padded(b if exact else np.convolve(b, self.interpolation))
        self.taps_slope = padded(np.convolve(b, slopes))
        self.feedback = padded(a)
        self._gain_slopes = dc_gain_slopes(a, b)

    def sections(self) -> tuple[Section, ...]:
        """G(z), one section."""
        return ((np.concatenate((np.zeros(self.offset), self.taps)), np.append(1.0, self.a)),)

    def zeros(self, rows: int) -> Array:
        return np.zeros((rows, self.offset + self.taps.size - 1 + self.feedback.size))

    def run(self, x: Array, state: State) -> tuple[Array, State]:
        y = np.empty_like(x)
        return y, self.run_into(x, state, y)

    def run_into(self, x: Array, state: State, y: Array) -> State:
        x0, z = state[0], state[1].copy()
        arx_row(x, x0, self.gain * x0, self.taps, self.offset, self.feedback, z[0], y)
        return x0, z

    def filter(self, x: Array, z: Array, y: Array) -> Array:
        z, rest = z.copy(), np.zeros(len(x))
        arx_filter(x, rest, rest, self.taps, self.offset, self.feedback, z, y)
        return z

    def linearise(self, x: Array, dx: Array, state: State, tangent: State) -> tuple[Array, Array, State, State]:
        x0, (dx0, dz, own), m = state[0], tangent, len(dx)
        rows, dz = extended(dx, len(self.names)), dz.copy()
        y, after = self.run(x, state)
        arx_filter(rows[:m], dx0, self.gain * dx0, self.taps, self.offset, self.feedback, dz, rows[:m])
        own = self._slopes(x - x0, y - self.gain * x0, self.gain_slopes() * x0, own, rows[m:])
        return y, rows, after, (dx0, dz, own)

    def c_form(self) -> CForm:
        rest = "s->x_rest = x;\ns->y_rest = gain * x;\nreturn s->y_rest;"
        return difference_equation(self.taps, self.offset, self.feedback, rest, gain=float(self.gain))

    def gain_slopes(self) -> Array:
        return self._gain_slopes

    def own_rest(self) -> State:
        before = self.first + self.taps_slope.size - 1
        return np.zeros((2, self.feedback.size)), np.zeros(before), np.zeros(self.a.size)

    def by_parameter(self, x: Array, y: Array, z: Array, own: State, rows: Array) -> State:
        return self._slopes(x, y, np.zeros(len(rows)), own, rows)

    def _slopes(self, x: Array, y: Array, at_rest: Array, own: State, rows: Array) -> State:
        poles, before_x, before_y = (part.copy() for part in own)
        taps, a = (self.taps_slope, self.first), (self.feedback, self.interpolation, self.a.size)
        arx_slopes(x, y, at_rest, *taps, *a, poles, before_x, before_y, rows)
        return poles, before_x, before_y
