"""Linear dynamics of the stage: ARX with delay."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..errors import ParameterError
from ..kernel import kernel
from ..parameter import Parameter
from .block import Block, State
from .effect import Effect, Place, Setting
from .lag import LagBlock
from .linear_block import LinearBlock

Array = NDArray[np.float64]


class Arx(Effect):
    """G(z) = B(z)/A(z)·z^(−d) from w to the position, Eq. (4) and (5).

    Parameters
    ----------
    a : sequence of float
        a1 … a_na of A(z) = 1 + a1 z⁻¹ + …, any length (also none); all poles inside the unit circle.
    b : sequence of float
        b1 … b_nb of B(z) = b1 + b2 z⁻¹ + …, at least one.
    delay : float
        d in samples, 1 or more; a fractional part is realised by third-order Lagrange interpolation.

    Raises
    ------
    ParameterError
        If a pole lies on or outside the unit circle, or `b` is empty.

    Notes
    -----
    Single coefficients of a high-order ARX are not identifiable (poles and zeros nearly cancel): compare G(f).
    In records slower than the model, G acts as its dc gain and its group delay at dc.

    Examples
    --------
    >>> round(Arx(a=[-0.9], b=[0.1]).dc_gain, 12)
    1.0
    """

    name = "arx"
    family = "dynamics"
    place = Place.DYNAMICS
    equation = "G(z) = z^(−d) (b1 + b2 z⁻¹ + …)/(1 + a1 z⁻¹ + …)"
    signature = "linear resonances and lag, the same at every amplitude"
    source = "paper, Eq. (4), (5)"
    parameters = (
        Parameter("a", "a_i", "1", (), -1e3, 1e3, "denominator coefficients", "paper, Eq. (5)"),
        Parameter("b", "b_i", "1", (1.0,), -1e6, 1e6, "numerator coefficients", "paper, Eq. (5)"),
        Parameter("delay", "d", "samples", 1.0, 1.0, 1e6, "dead time of the stage", "paper, Eq. (4)"),
    )

    def check(self) -> None:
        if self.array("b").size == 0:
            raise ParameterError("arx.b: got no coefficient, expected at least one")
        radius = self.pole_radius
        if radius >= 1.0:
            raise ParameterError(f"arx.a: unstable, got a pole of radius {radius:.6g}, expected all below 1")

    @property
    def pole_radius(self) -> float:
        """Largest pole radius."""
        a = self.array("a")
        return float(np.abs(np.roots(np.concatenate(([1.0], a)))).max()) if a.size else 0.0

    @property
    def dc_gain(self) -> float:
        """G(1)."""
        return float(self.array("b").sum() / (1.0 + self.array("a").sum()))

    @property
    def group_delay(self) -> float:
        """Group delay near dc in samples, delay included."""
        a, b = self.array("a"), self.array("b")
        lag_b = np.arange(b.size) @ b / b.sum() if b.sum() else 0.0
        return float(self["delay"] + lag_b - np.arange(1, a.size + 1) @ a / (1.0 + a.sum()))

    def response(self, frequency: Array, sample_period: float) -> NDArray[np.complex128]:
        """G at `frequency` [Hz], shape (k,), complex."""
        z = np.exp(-2j * np.pi * np.asarray(frequency) * sample_period)
        numerator = np.polyval(self.array("b")[::-1], z)
        denominator = np.polyval(np.concatenate(([1.0], self.array("a")))[::-1], z)
        return np.asarray(numerator / denominator * z ** self["delay"])

    def block(self, setting: Setting, terms: tuple[Effect, ...] = ()) -> Block:
        names = tuple(f"{self.name}.{n}" for n in self.free_names())
        if not setting.is_slow:
            return ArxBlock(names, self.array("a"), self.array("b"), self["delay"])
        a, b, ratio = self.array("a"), self.array("b"), setting.model_period / setting.sample_period
        at_a, at_b = 1.0 + a.sum(), b.sum()
        power = np.arange(1, a.size + 1)
        lag_a, lag_b = power @ a / at_a, np.arange(b.size) @ b / at_b
        gain_slopes = np.concatenate((np.full(a.size, -at_b / at_a**2), np.full(b.size, 1.0 / at_a), [0.0]))
        lag_slopes = ratio * np.concatenate((-(power - lag_a) / at_a, (np.arange(b.size) - lag_b) / at_b, [1.0]))
        lag = max(0.0, ratio * self.group_delay)
        return LagBlock(names, self.dc_gain, lag, gain_slopes, lag_slopes)


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
