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

"""A second mode of the structure in addition to the identified dynamics."""

from __future__ import annotations

from typing import Self

import numpy as np
from scipy.linalg import expm, expm_frechet

from ...blocks.block import Array, Block, Section, State
from ...blocks.fir import FirBlock
from ...blocks.kernel import kernel
from ...blocks.linear import AddedBlock
from ...c_form import CForm
from ...parameter import Parameter
from ..effect import ChainPosition, Discretisation, Effect
from ..excitation_need import ExcitationNeed
from ..extent import Extent
from ..invertibility import Invertibility

RESOLVED = 0.45
"""Highest simulated frequency of the mode [cycles per sample]; a faster mode is replaced by its delay at dc."""


class ExtraResonance(Effect):
    """A further mode with the share r of the static response.

    Parameters
    ----------
    r : float
        Share of the mode in the static response [1].
    f0 : float
        Natural frequency [Hz].
    zeta : float
        Damping ratio [1].

    Notes
    -----
    The block is exact for an input that is linear between samples (first-order hold). The start value of f0 is the peak
    of |E(f)|/|Y(f)|, the ratio of the spectra of residual and displacement.

    The fitted r, and its interval, are those of this form, as a prediction needs them. A converter that holds its value
    excites the mode more, by 1/sinc(f0 T). The interpolation of a delay reduces the response by L(f0), and poles of the
    dynamics that the stage has not reduce it by P(f0). The fit makes up for this: r is the true share divided by
    sinc(f0 T) L(f0) P(f0), and smaller by a true pole that the model does not have. Fitted to stages that ring as a
    whole, so that the true share is 1, with delays of 0 to 4 samples, poles of 0 to T, steps, and sines up to 0.006/T:

    ======  =================  =================  =========================
    f0 T    r, up to one pole  r, with two poles  half of its 95 % interval
    ======  =================  =================  =========================
    ≤ 0.05  1.00                                  0.01 to 0.02
    0.1     1.01 to 1.02                          0.01 to 0.02
    0.2     1.03 to 1.11       1.31               0.02 to 0.08
    0.3     1.04 to 1.43       1.94               0.02 to 0.14
    0.4     2.7                                   0.24
    ======  =================  =================  =========================

    At 0.45, r is up to 9. The formula holds within 1 % of r, and within 3 % with a pole before the hysteresis if this
    counts as that of the stage. The intervals of f0 and ζ held the true ones; f0 was off by 0.02 % at most, and ζ by
    0.5 %.
    """

    name = "extra_resonance"
    invertibility = Invertibility.EXACT
    family = "dynamics"
    place = ChainPosition.DYNAMICS
    excitation_need = ExcitationNeed.BROADBAND
    equation = "y = x + r (q − x),  q̈/ω0² + 2 ζ q̇/ω0 + q = x,  ω0 = 2π f0"
    signature = "The stage rings at one frequency after steps. The ratio of residual to response has a peak there"
    source = "modes of the structure, ζ 0.005–0.03"
    parameters = (
        Parameter(
            "r", "r", "1", 0.0, -10.0, 10.0, "share of the mode, first-order hold", "modal superposition", 0.0, 0.02
        ),
        Parameter("f0", "f0", "Hz", 500.0, 1.0, 1e5, "natural frequency", "modal superposition", scale=10.0),
        Parameter("zeta", "ζ", "1", 0.01, 1e-4, 1.0, "damping ratio", "0.005–0.03 in structures", scale=0.005),
    )

    @classmethod
    def starts(cls, extent: Extent) -> tuple[Self, ...]:
        return tuple(cls(f0=peak, zeta=0.02) for peak in extent.peaks)

    def block(self, setting: Discretisation, terms: tuple[Effect, ...] = ()) -> Block:
        if self["f0"] * setting.sample_period <= RESOLVED:
            return ModeBlock(self["r"], self["f0"], self["zeta"], setting.sample_period)
        unit = 1.0 / (np.pi * self["f0"] * setting.sample_period)
        lag = self["r"] * self["zeta"] * unit
        by = (self["zeta"] * unit, -lag / self["f0"], self["r"] * unit)
        names = tuple(f"{self.name}.{p.name}" for p in self.parameters)
        return FirBlock(names, 0, np.array([1.0 - lag, lag]), np.outer(by, [-1.0, 1.0]))


def oscillator(f0: float, zeta: float, sample_period: float) -> tuple[Array, Array]:
    """One sample step of an oscillator, exact for an input that changes linearly from u to u + du.

    Parameters
    ----------
    f0 : float
        Natural frequency [Hz].
    zeta : float
        Damping ratio [1].
    sample_period : float
        Duration of the step [s].

    Returns
    -------
    step : (2, 4) ndarray
        Matrix that gives position and velocity/ω0 after the step from (position, velocity/ω0, u, du) before it.
    slopes : (2, 2, 4) ndarray
        Its derivatives with respect to f0 and to ζ.
    """
    angle = 2.0 * np.pi * f0 * sample_period
    rate = np.zeros((4, 4))
    rate[0, 1], rate[1, :3] = angle, [-angle, -2.0 * zeta * angle, angle]
    by_zeta = np.zeros((4, 4))
    by_zeta[1, 1] = -2.0 * angle
    by_f0 = rate / f0
    rate[2, 3] = 1.0
    slopes = [expm_frechet(rate, direction, compute_expm=False)[:2] for direction in (by_f0, by_zeta)]
    return np.ascontiguousarray(expm(rate)[:2]), np.ascontiguousarray(slopes)


@kernel
def run_mode(u, step, z, q):
    """Positions q (r, n) for the inputs u (r, n); z (r, 3) = last input, position, velocity/ω0 is updated."""
    p0, p1, p2, p3 = step[0, 0], step[0, 1], step[0, 2], step[0, 3]
    v0, v1, v2, v3 = step[1, 0], step[1, 1], step[1, 2], step[1, 3]
    for r in range(u.shape[0]):
        last, position, velocity = z[r, 0], z[r, 1], z[r, 2]
        for i in range(u.shape[1]):
            x = u[r, i]
            pushed, turned = p2 * last + p3 * (x - last), v2 * last + v3 * (x - last)
            moved = p0 * position + p1 * velocity + pushed
            velocity = v0 * position + v1 * velocity + turned
            position, last = moved, x
            q[r, i] = position
        z[r, 0], z[r, 1], z[r, 2] = last, position, velocity


@kernel
def mode_slopes(u, step, slopes, z, dz, dq):
    """Derivatives dq (2, n) of q by f0 and ζ for u (n,); z (3,), as in `run_mode`, and dz (2, 2) are updated."""
    for i in range(u.size):
        du = u[i] - z[0]
        for k in range(2):
            s = slopes[k]
            forced = s[0, 0] * z[1] + s[0, 1] * z[2] + s[0, 2] * z[0] + s[0, 3] * du
            pushed = s[1, 0] * z[1] + s[1, 1] * z[2] + s[1, 2] * z[0] + s[1, 3] * du
            moved = step[0, 0] * dz[k, 0] + step[0, 1] * dz[k, 1] + forced
            dz[k, 1] = step[1, 0] * dz[k, 0] + step[1, 1] * dz[k, 1] + pushed
            dz[k, 0] = moved
            dq[k, i] = moved
        moved = step[0, 0] * z[1] + step[0, 1] * z[2] + (step[0, 2] * z[0] + step[0, 3] * du)
        z[2] = step[1, 0] * z[1] + step[1, 1] * z[2] + (step[1, 2] * z[0] + step[1, 3] * du)
        z[1], z[0] = moved, u[i]


STEP = """\
const double u = x - s->x_rest, du = u - s->last;
const double pushed = p[2] * s->last + p[3] * du, turned = v[2] * s->last + v[3] * du;
const double moved = p[0] * s->position + p[1] * s->velocity + pushed;
s->velocity = v[0] * s->position + v[1] * s->velocity + turned;
s->position = moved;
s->last = u;
return x + r * (moved - u);
"""
"""C code of `run_mode` for one sample."""


class ModeBlock(AddedBlock):
    """x + r (q − x); state: last input, position, velocity/ω0."""

    names: tuple[str, ...] = ("extra_resonance.r", "extra_resonance.f0", "extra_resonance.zeta")

    def __init__(self, r: float, f0: float, zeta: float, sample_period: float) -> None:
        self.r = r
        self.step, self.slopes = oscillator(f0, zeta, sample_period)

    @property
    def is_idle(self) -> bool:
        return self.r == 0.0

    def sections(self) -> tuple[Section, ...]:
        """1 + r (Q − 1), one section."""
        (p0, p1, p2, p3), (v0, v1, v2, v3) = self.step
        poles = np.array([1.0, -(p0 + v1), p0 * v1 - p1 * v0])
        mode = np.convolve([1.0, -v1], [p3, p2 - p3]) + p1 * np.array([0.0, v3, v2 - v3])
        return (((1.0 - self.r) * poles + self.r * mode, poles),)

    def zeros(self, rows: int) -> Array:
        return np.zeros((rows, 3))

    def filter(self, x: Array, z: Array, y: Array) -> Array:
        z = z.copy()
        run_mode(x, self.step, z, y)
        y -= x
        y *= self.r
        return z

    def own_rest(self) -> State:
        return np.zeros((2, 2))

    def by_parameter(self, x: Array, y: Array, z: Array, own: State, rows: Array) -> State:
        own = own.copy()
        run_mode(x[None, :], self.step, z[None, :].copy(), rows[:1])
        rows[0] -= x
        mode_slopes(x, self.step, self.slopes, z.copy(), own, rows[1:])
        rows[1:] *= self.r
        return own

    def c_form(self) -> CForm:
        state = ("double x_rest, last, position, velocity",)
        numbers = {"r": self.r, "p": self.step[0], "v": self.step[1]}
        return CForm(STEP, "memset(s, 0, sizeof *s);\ns->x_rest = x;\nreturn x;", numbers, state)
