"""The modified Bouc-Wen operator in the discrete form of the paper, Eq. (6) and (7)."""

from __future__ import annotations

import numpy as np

from ..kernel import kernel
from ..parameter import Parameter
from .block import Array, Block, State
from .bouc_wen import MODIFIED_BOUC_WEN, check_bounded
from .effect import Effect, Place, Setting


class PublishedBoucWen(Effect):
    """Modified Bouc-Wen by the explicit step of Eq. (7), with the exponent n of Eq. (2).

    Parameters
    ----------
    A, beta, gamma, n : float
        Loop of Eq. (2), dimensionless; beta >= |gamma|, n >= 1.
    p1, p2 : float
        Polynomial of Eq. (6); p1 = 0 is the classical Bouc-Wen (CBW), Eq. (1).

    Notes
    -----
    An explicit Euler step: the result depends on the sample rate (4 % of the h range for white noise at 50 kHz). It
    reproduces published figures; `BoucWen` is the form to identify with.
    """

    name = "published_bouc_wen"
    family = "hysteresis"
    place = Place.HYSTERESIS
    equation = "w_i = p1 v_i³ + p2 v_i + h_i;  h_i = h_(i−1) + A Δv − β|Δv||h|^(n−1)h − γ Δv|h|^n"
    signature = "as bouc_wen, but dependent on the sample rate"
    source = "paper, Eq. (6), (7); exponent of Eq. (2)"
    parameters = (
        *MODIFIED_BOUC_WEN,
        Parameter("n", "n", "1", 1.0, 1.0, 4.0, "exponent of the loop; 1 for piezo stages", "paper, Eq. (2)"),
    )

    def check(self) -> None:
        check_bounded(self)

    def block(self, setting: Setting, terms: tuple[Effect, ...] = ()) -> Block:
        return PublishedBlock(self)


@kernel
def run_published(v, p, n, state, h_out):
    """Eq. (7); p = [A, beta, gamma], state = [h, v_last] is updated, h_out (n,) filled."""
    a, beta, gamma = p[0], p[1], p[2]
    h, last = state[0], state[1]
    if n == 1.0:
        for i in range(v.size):
            dv = v[i] - last
            last = v[i]
            h = h + (a * dv - (beta * abs(dv) * h + gamma * dv * abs(h)))
            h_out[i] = h
    else:
        for i in range(v.size):
            dv = v[i] - last
            last = v[i]
            power = abs(h) ** (n - 1.0)
            h = h + (a * dv - power * (beta * abs(dv) * h + gamma * dv * abs(h)))
            h_out[i] = h
    state[0], state[1] = h, last


@kernel
def linearise_published(v, dv_in, p, n, state, tangent, last_in, h_out, dh_out):
    """`run_published` with rows: m incoming, then A, beta, gamma, n; tangent (m + 4,) and last_in (m,) are updated."""
    a, beta, gamma = p[0], p[1], p[2]
    m = dv_in.shape[0]
    h, last = state[0], state[1]
    for i in range(v.size):
        dv = v[i] - last
        last = v[i]
        size = abs(h)
        power = 1.0 if n == 1.0 else size ** (n - 1.0)
        loss = beta * abs(dv) * h + gamma * dv * size
        sign = np.sign(h)
        keep = 1.0 - power * (beta * abs(dv) + gamma * dv * sign) * n
        for j in range(m):
            move = dv_in[j, i] - last_in[j]
            direction = np.sign(dv if dv != 0.0 else move)
            tangent[j] = keep * tangent[j] + (a - power * (beta * direction * h + gamma * size)) * move
            last_in[j] = dv_in[j, i]
        tangent[m] = keep * tangent[m] + dv
        tangent[m + 1] = keep * tangent[m + 1] - power * abs(dv) * h
        tangent[m + 2] = keep * tangent[m + 2] - power * dv * size
        by_n = -power * np.log(size) * loss if size > 0.0 else 0.0
        tangent[m + 3] = keep * tangent[m + 3] + by_n
        h = h + (a * dv - power * loss)
        h_out[i] = h
        for j in range(m + 4):
            dh_out[j, i] = tangent[j]
    state[0], state[1] = h, last


class PublishedBlock(Block):
    """State [h, v_last]."""

    keeps_state = True
    names = tuple(f"published_bouc_wen.{n}" for n in ("A", "beta", "gamma", "n", "p1", "p2"))

    def __init__(self, effect: PublishedBoucWen) -> None:
        self.p1, self.p2, self.n = effect["p1"], effect["p2"], effect["n"]
        self.loop = np.array([effect["A"], effect["beta"], effect["gamma"]])

    def static(self, x0: float) -> float:
        return self.p1 * x0 * x0 * x0 + self.p2 * x0

    def static_slopes(self, x0: float) -> tuple[float, Array]:
        return 3 * self.p1 * x0 * x0 + self.p2, np.array([0.0, 0.0, 0.0, 0.0, x0**3, x0])

    def rest(self, x0: float, time: float) -> State:
        return np.array([0.0, x0])

    def run(self, x: Array, state: State) -> tuple[Array, State]:
        h, state = np.empty_like(x), state.copy()
        run_published(x, self.loop, self.n, state, h)
        return self.p1 * x * x * x + self.p2 * x + h, state

    def rest_tangent(self, x0: float, dx0: Array) -> State:
        return np.zeros(len(dx0) + 4), np.array(dx0)

    def linearise(self, x: Array, dx: Array, state: State, tangent: State) -> tuple[Array, Array, State, State]:
        h, state = np.empty_like(x), state.copy()
        slopes, last = tangent[0].copy(), tangent[1].copy()
        rows = np.empty((len(slopes), x.size))
        linearise_published(x, np.ascontiguousarray(dx), self.loop, self.n, state, slopes, last, h, rows)
        rows[: len(dx)] += (3 * self.p1 * x * x + self.p2) * dx
        y = self.p1 * x * x * x + self.p2 * x + h
        return y, np.vstack((rows, x * x * x, x)), state, (slopes, last)
