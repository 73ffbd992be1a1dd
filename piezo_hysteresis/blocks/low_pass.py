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

"""`LowPassBlock`: equal poles in series, exact for an input that is linear or constant between samples."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..c_form import CForm
from ..inverse_terms import InverseStart, InverseTerms
from .block import Array, Section, State
from .kernel import kernel
from .linear import AddedBlock
from .relaxation import hold


class PoleStep(NamedTuple):
    """Coefficients of one pole, y_i = left y_(i−1) + lead x_i + back x_(i−1), and their derivatives by τ [1/s]."""

    left: float
    lead: float
    back: float
    left_slope: float
    lead_slope: float
    back_slope: float


def linear_step(tau: float, sample_period: float) -> PoleStep:
    """A pole of time constant `tau` [s] whose input is linear between samples; its lag near dc is τ.

    >>> step = linear_step(1.0, 1.0)
    >>> round(step.lead, 6), round(step.back, 6)
    (0.367879, 0.264241)
    """
    fade, lead, fade_slope, lead_slope = (float(c[0]) for c in hold(np.array([tau]), sample_period))
    return PoleStep(1.0 - fade, lead, fade - lead, -fade_slope, lead_slope, fade_slope - lead_slope)


def held_step(tau: float, sample_period: float) -> PoleStep:
    """A pole whose input jumps after a sample, stays there, and is observed at the end of the period.

    The period in which the input is held is a delay, which is not part of this pole. Its lag near dc is `held_lag`.

    >>> step = held_step(1.0, 1.0)
    >>> round(step.lead, 6), step.back
    (0.632121, 0.0)
    """
    fade, _, fade_slope, _ = (float(c[0]) for c in hold(np.array([tau]), sample_period))
    return PoleStep(1.0 - fade, fade, 0.0, -fade_slope, fade_slope, 0.0)


def held_lag(tau: float, sample_period: float) -> tuple[float, float]:
    """Lag near dc of `held_step` [s], T/(e^(T/τ) − 1), and its derivative by τ [1].

    >>> [round(value, 6) for value in held_lag(1.0, 1.0)]
    [0.581977, 0.920674]
    """
    step = held_step(tau, sample_period)
    fade = step.lead
    return sample_period * step.left / fade, sample_period * step.left_slope / fade**2


@kernel
def run_poles(u, left, lead, back, z, y):
    """Rows of u (r, n) through z.shape[1] − 1 equal poles; z (r, 1 + poles) = last input and outputs, updated."""
    for r in range(u.shape[0]):
        y[r] = u[r]
        for k in range(1, z.shape[1]):
            before, after = z[r, k - 1], z[r, k]
            for i in range(u.shape[1]):
                x = y[r, i]
                after = left * after + lead * x + back * before
                before = x
                y[r, i] = after
            z[r, k - 1] = before
        z[r, z.shape[1] - 1] = y[r, u.shape[1] - 1]


@kernel
def poles_by_tau(u, left, lead, back, left_slope, lead_slope, back_slope, z, dz, dy):
    """∂y/∂τ (n,) of one row u (n,); z and dz (1 + poles,) are updated, dz[0] is zero."""
    for i in range(u.size):
        before, x, dbefore, dx = z[0], u[i], 0.0, 0.0
        z[0] = x
        for k in range(1, z.size):
            dafter = left * dz[k] + lead * dx + back * dbefore
            dafter += left_slope * z[k] + lead_slope * x + back_slope * before
            after = left * z[k] + lead * x + back * before
            before, x, dbefore, dx = z[k], after, dz[k], dafter
            z[k], dz[k] = after, dafter
        dy[i] = dx


STEP = """\
double y = x - s->x_rest, before = s->z[0], after;
int k;
s->z[0] = y;
for (k = 1; k <= POLES; k++) {
    after = left * s->z[k] + lead * y + back * before;
    before = s->z[k];
    s->z[k] = y = after;
}
return x + (y - (x - s->x_rest));
"""
"""C code of `run_poles` for one sample."""


class LowPassBlock(AddedBlock):
    """`count` equal poles; τ = 0 gives y = x.

    Parameters
    ----------
    name : str
        Name of the parameter τ.
    step : PoleStep
        Coefficients of each pole.
    count : int
        Number of poles.
    """

    keeps_state = True

    def __init__(self, name: str, step: PoleStep, count: int = 1) -> None:
        self.names, self.count = (name,), count
        self.step, self.slopes = step[:3], step[3:]

    def sections(self) -> tuple[Section, ...]:
        """One section for every pole."""
        left, lead, back = self.step
        return ((np.array([lead, back]), np.array([1.0, -left])),) * self.count

    @property
    def is_idle(self) -> bool:
        return self.step == (0.0, 1.0, 0.0)

    def zeros(self, rows: int) -> Array:
        return np.zeros((rows, 1 + self.count))

    def filter(self, x: Array, z: Array, y: Array) -> Array:
        z = z.copy()
        run_poles(x, *self.step, z, y)
        y -= x
        return z

    def _linearise_idle(self, x: Array, dx: Array, state: State, tangent: State) -> tuple[Array, Array, State, State]:
        x, rows, state, (dx0, _, own) = super()._linearise_idle(x, dx, state, tangent)
        last = rows[: len(dx), -1] - dx0
        # a short time constant makes no difference at a long sample period, but may do so at the one that follows
        return x, rows, state, (dx0, np.repeat(last[:, None], 1 + self.count, axis=1), own)

    def c_form(self) -> CForm:
        left, lead, back = self.step
        numbers = {"POLES": self.count, "left": left, "lead": lead, "back": back}
        state = ("double x_rest", f"double z[{1 + self.count}]")
        return CForm(STEP, "memset(s, 0, sizeof *s);\ns->x_rest = x;\nreturn x;", numbers, state)

    def inverse_terms(self) -> InverseTerms | None:
        return InverseTerms(dict(zip(("left", "lead", "back"), self.step, strict=True))) if self.count == 1 else None

    def inverse_start(self, x: float, state: State) -> InverseStart:
        x0, z = state
        return InverseStart({"slewed": x0 + z[0, 0], **dict.fromkeys(("pole", "held", "pushed"), x0 + z[0, 1])})

    def own_rest(self) -> State:
        return np.zeros(1 + self.count)

    def by_parameter(self, x: Array, y: Array, z: Array, own: State, rows: Array) -> State:
        own = own.copy()
        poles_by_tau(x, *self.step, *self.slopes, z.copy(), own, rows[0])
        return own
