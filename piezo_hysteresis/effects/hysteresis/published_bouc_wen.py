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

"""The modified Bouc-Wen operator in the discrete form of the paper, Eq. (6) and (7)."""

from __future__ import annotations

import numpy as np

from ...blocks.block import Array, Block, State
from ...blocks.kernel import fma, kernel
from ...c_form import CForm
from ...errors import ModelError
from ...inverse_terms import PUBLISHED, InverseStart, InverseTerms, LoopTerms
from ...parameter import Parameter
from ..effect import Discretisation, Effect
from ..invertibility import Invertibility
from .bouc_wen import MODIFIED_BOUC_WEN, BoucWen, ModifiedBoucWen


class PublishedBoucWen(ModifiedBoucWen):
    """Modified Bouc-Wen operator with the explicit step of Eq. (7) and the exponent n of Eq. (2).

    Parameters
    ----------
    A, beta, gamma, n : float
        Loop of Eq. (2), dimensionless; beta >= |gamma|, n >= 1.
    p1, p2 : float
        Polynomial of Eq. (6); p1 = 0 is the classical Bouc-Wen (CBW), Eq. (1).

    Notes
    -----
    Eq. (7) is an explicit Euler step. Its result depends on the sample rate (by 4 % of the range of h for white noise
    at 50 kHz).
    Use it to reproduce published figures, and `BoucWen` for identification.
    """

    name = "published_bouc_wen"
    invertibility = Invertibility.EXACT
    equation = "w_i = p1 v_i³ + p2 v_i + h_i;  h_i = h_(i−1) + A Δv − β|Δv||h|^(n−1)h − γ Δv|h|^n"
    signature = "The loops are those of bouc_wen, but depend on the sample rate"
    source = "paper, Eq. (6), (7); exponent of Eq. (2)"
    parameters = (
        *MODIFIED_BOUC_WEN,
        Parameter(
            "n", "n", "1", 1.0, 1.0, 4.0, "exponent of the loop; 1 for piezo stages", "paper, Eq. (2)", fixed=True
        ),
    )

    def exact(self) -> BoucWen:
        if self["n"] != 1.0:
            raise ModelError(f"{self.name}: got n = {self['n']:g}, expected 1, for which the step is known exactly")
        return BoucWen(**{n: v for n, v in self.values.items() if n != "n"})

    def block(self, setting: Discretisation, terms: tuple[Effect, ...] = ()) -> Block:
        return PublishedBlock(self)


@kernel
def step(h, dv, a, beta, gamma, n):
    """h of Eq. (7) after Δv; for n = 1 few operations depend on the last h."""
    if n == 1.0:
        return fma(-gamma * dv, abs(h), fma(h, fma(-beta, abs(dv), 1.0), a * dv))
    return h + (a * dv - (beta * abs(dv) * h + gamma * dv * abs(h)) * abs(h) ** (n - 1.0))


@kernel
def output(x, h, p1, p2):
    """w of Eq. (6)."""
    return fma(fma(p1 * x, x, p2), x, h)


@kernel
def run_published(v, p, state, w):
    """Eq. (6) and (7); p = [A, beta, gamma, n, p1, p2], state = [h, v_last] is updated, w (n,) filled."""
    a, beta, gamma, n, p1, p2 = p[0], p[1], p[2], p[3], p[4], p[5]
    h, last = state[0], state[1]
    for i in range(v.size):
        x = v[i]
        dv = x - last
        last = x
        h = step(h, dv, a, beta, gamma, n)
        w[i] = output(x, h, p1, p2)
    state[0], state[1] = h, last


@kernel
def linearise_plain(v, p, state, tangent, w, dw):
    """`linearise_published` for n = 1 without incoming rows; fast, because it needs few registers."""
    a, beta, gamma, p1, p2 = p[0], p[1], p[2], p[4], p[5]
    h, last = state[0], state[1]
    by_a, by_beta, by_gamma = tangent[0], tangent[1], tangent[2]
    row_a, row_beta, row_gamma, row_1, row_2 = dw[0], dw[1], dw[2], dw[3], dw[4]
    for i in range(v.size):
        x = v[i]
        dv = x - last
        last = x
        damp, turn = beta * abs(dv), gamma * dv
        keep = 1.0 - (damp + turn if h >= 0.0 else damp - turn)
        by_a = keep * by_a + dv
        by_beta = keep * by_beta - abs(dv) * h
        by_gamma = keep * by_gamma - dv * abs(h)
        row_a[i], row_beta[i], row_gamma[i] = by_a, by_beta, by_gamma
        h = step(h, dv, a, beta, gamma, 1.0)
        w[i] = output(x, h, p1, p2)
    for i in range(v.size):
        row_1[i], row_2[i] = v[i] * v[i] * v[i], v[i]
    state[0], state[1] = h, last
    tangent[0], tangent[1], tangent[2] = by_a, by_beta, by_gamma


@kernel
def linearise_published(v, dv_in, p, state, tangent, last_in, w, dw):
    """`run_published` and derivatives dw (m + 5, n): by the m incoming rows dv_in, then by A, β, γ, p1, p2.

    tangent (m + 3,) and last_in (m,) are updated. The exponent n is not fitted and has no row.
    """
    if dv_in.shape[0] == 0 and p[3] == 1.0:
        linearise_plain(v, p, state, tangent, w, dw)
        return
    a, beta, gamma, n, p1, p2 = p[0], p[1], p[2], p[3], p[4], p[5]
    m = dv_in.shape[0]
    h, last = state[0], state[1]
    by_a, by_beta, by_gamma = tangent[m], tangent[m + 1], tangent[m + 2]
    for i in range(v.size):
        x = v[i]
        dv = x - last
        last = x
        damp, turn = beta * abs(dv), gamma * dv
        size, power = abs(h), 1.0
        if n != 1.0:
            power = size ** (n - 1.0)
        keep = 1.0 - n * power * (damp + turn if h >= 0.0 else damp - turn)
        by_v = 3.0 * p1 * x * x + p2
        for j in range(m):
            move = dv_in[j, i] - last_in[j]
            direction = np.sign(dv if dv != 0.0 else move)
            tangent[j] = keep * tangent[j] + (a - power * (beta * direction * h + gamma * size)) * move
            last_in[j] = dv_in[j, i]
            dw[j, i] = tangent[j] + by_v * dv_in[j, i]
        by_a = keep * by_a + dv
        by_beta = keep * by_beta - power * abs(dv) * h
        by_gamma = keep * by_gamma - power * dv * size
        dw[m, i], dw[m + 1, i], dw[m + 2, i] = by_a, by_beta, by_gamma
        dw[m + 3, i], dw[m + 4, i] = x * x * x, x
        h = step(h, dv, a, beta, gamma, n)
        w[i] = output(x, h, p1, p2)
    state[0], state[1] = h, last
    tangent[m], tangent[m + 1], tangent[m + 2] = by_a, by_beta, by_gamma


STEP = """\
/* h of Eq. (7) after dv. */
static double published_step(double h, double dv, double a, double beta, double gamma, double n)
{
    if (n == 1.0) {
        return FMA(-gamma * dv, fabs(h), FMA(h, FMA(-beta, fabs(dv), 1.0), a * dv));
    }
    return h + (a * dv - (beta * fabs(dv) * h + gamma * dv * fabs(h)) * pow(fabs(h), n - 1.0));
}
"""
"""C function of `step`."""


class PublishedBlock(Block):
    """The operator of Eq. (6) and (7); state [h, v_last]."""

    keeps_state = True
    names = tuple(f"published_bouc_wen.{n}" for n in ("A", "beta", "gamma", "p1", "p2"))

    def __init__(self, effect: PublishedBoucWen) -> None:
        self.p = np.array([effect[n] for n in ("A", "beta", "gamma", "n", "p1", "p2")])

    def static(self, x0: float) -> float:
        return float(self.p[4] * x0 * x0 * x0 + self.p[5] * x0)

    def static_slopes(self, x0: float) -> tuple[float, Array]:
        return float(3.0 * self.p[4] * x0 * x0 + self.p[5]), np.array([0.0, 0.0, 0.0, x0**3, x0])

    def rest(self, x0: float, time: float) -> State:
        return np.array([0.0, x0])

    def run(self, x: Array, state: State) -> tuple[Array, State]:
        w, state = np.empty_like(x), state.copy()
        run_published(x, self.p, state, w)
        return w, state

    def rest_tangent(self, x0: float, dx0: Array) -> State:
        return np.zeros(len(dx0) + 3), np.array(dx0)

    def linearise(self, x: Array, dx: Array, state: State, tangent: State) -> tuple[Array, Array, State, State]:
        w, state = np.empty_like(x), state.copy()
        slopes, last = tangent[0].copy(), tangent[1].copy()
        rows = np.empty((len(dx) + 5, x.size))
        linearise_published(x, dx, self.p, state, slopes, last, w, rows)
        return w, rows, state, (slopes, last)

    def c_form(self) -> CForm:
        step = (
            "s->h = published_step(s->h, x - s->v, A, beta, gamma, n);\ns->v = x;\n"
            "return FMA(FMA(p1 * x, x, p2), x, s->h);"
        )
        rest = "s->h = 0.0;\ns->v = x;\nreturn p1 * x * x * x + p2 * x;"
        numbers = dict(zip(("A", "beta", "gamma", "n", "p1", "p2"), self.p.tolist(), strict=True))
        return CForm(step, rest, numbers, ("double h, v",), (STEP,))

    def inverse_terms(self) -> InverseTerms:
        loop = LoopTerms(PUBLISHED, np.append(self.p[:4], np.zeros(4)), library=(STEP,))
        return InverseTerms(polynomial={"p1": float(self.p[4]), "p2": float(self.p[5])}, loop=loop)

    def inverse_start(self, x: float, state: State) -> InverseStart:
        return InverseStart(h=state[0])
