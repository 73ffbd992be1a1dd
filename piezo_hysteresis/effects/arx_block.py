"""`ArxBlock`: the difference equation of the ARX at the model's own sample period."""

from __future__ import annotations

import numpy as np

from ..kernel import kernel
from .block import Array, State
from .linear_block import LinearBlock


def lagrange(fraction: float) -> tuple[Array, Array]:
    """Third-order interpolation at delay 1 + fraction over taps 0 … 3, and its derivative, each shape (4,).

    >>> lagrange(0.0)[0].tolist()
    [0.0, 1.0, 0.0, 0.0]
    """
    nodes, at = np.arange(4.0), 1.0 + fraction
    taps, slopes = np.empty(4), np.empty(4)
    for k in range(4):
        others = np.delete(nodes, k)
        scale = float(np.prod(k - others))
        taps[k] = float(np.prod(at - others)) / scale
        slopes[k] = sum(float(np.prod(at - np.delete(others, j))) for j in range(3)) / scale
    return taps + 0.0, slopes


@kernel
def arx_filter(x, taps, offset, a, z, y):
    """Rows of x (r, n) through taps delayed by offset and 1/A; z (r, inputs + na) is updated, y (r, n) filled."""
    inputs = offset + taps.size - 1
    n = x.shape[1]
    held = np.empty(inputs + n)
    out = np.empty(a.size + n)
    na = a.size
    for r in range(x.shape[0]):
        held[:inputs] = z[r, :inputs]
        held[inputs:] = x[r]
        out[:na] = z[r, inputs:]
        for i in range(n):
            out[na + i] = taps[0] * held[inputs - offset + i]
        for k in range(1, taps.size):
            for i in range(n):
                out[na + i] += taps[k] * held[inputs - offset - k + i]
        for i in range(na, na + n):
            total = out[i]
            for j in range(na, 0, -1):
                total -= a[j - 1] * out[i - j]
            out[i] = total
        y[r] = out[na:]
        z[r, :inputs] = held[n:]
        z[r, inputs:] = out[n:]


class ArxBlock(LinearBlock):
    """The difference equation at the model's own sample period; history of inputs and outputs as state."""

    def __init__(self, names: tuple[str, ...], a: Array, b: Array, delay: float) -> None:
        self.names, self.a, self.b = names, a, b
        self.gain = b.sum() / (1.0 + a.sum())
        whole = int(delay)
        self.interpolation, self.interpolation_slopes = lagrange(delay - whole)
        self.first = whole - 1
        self.taps, self.offset = (b, whole) if delay == whole else (np.convolve(b, self.interpolation), whole - 1)

    def zeros(self, rows: int) -> Array:
        return np.zeros((rows, self.offset + self.taps.size - 1 + self.a.size))

    def filter(self, x: Array, z: Array) -> tuple[Array, Array]:
        y, z = np.empty(x.shape), z.copy()
        arx_filter(np.ascontiguousarray(x), self.taps, self.offset, self.a, z, y)
        return y, z

    def gain_slopes(self) -> Array:
        at_a = 1.0 + self.a.sum()
        return np.concatenate((np.full(self.a.size, -self.b.sum() / at_a**2), np.full(self.b.size, 1.0 / at_a), [0.0]))

    def own_rest(self) -> State:
        return np.zeros((2, self.a.size)), np.zeros(self.first + self.b.size + 3), np.zeros(self.a.size)

    def by_parameter(self, x: Array, y: Array, z: Array, own: State) -> tuple[Array, State]:
        poles, before_x, before_y = own
        na, nb, n = self.a.size, self.b.size, x.size
        filtered, poles = np.empty((2, n)), poles.copy()
        arx_filter(np.vstack((x, y)), np.ones(1), 0, self.a, poles, filtered)
        by_x = np.concatenate((before_x, filtered[0]))
        by_y = np.concatenate((before_y, filtered[1]))
        rows = np.empty((na + nb + 1, n))
        for j in range(na):
            rows[j] = -by_y[na - j - 1 : na - j - 1 + n]
        size = before_x.size
        delayed = [by_x[size - self.first - k : size - self.first - k + n] for k in range(nb + 3)]
        for j in range(nb):
            rows[na + j] = sum(t * delayed[j + k] for k, t in enumerate(self.interpolation) if t != 0.0)
        slopes = np.convolve(self.b, self.interpolation_slopes)
        rows[-1] = sum(t * delayed[k] for k, t in enumerate(slopes))
        return rows, (poles, by_x[n:].copy(), by_y[n:].copy())
