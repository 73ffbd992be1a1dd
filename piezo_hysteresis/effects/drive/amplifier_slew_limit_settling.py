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

"""Largest current of an amplifier that settles exponentially."""

from __future__ import annotations

import math

import numpy as np

from ...blocks.block import Array, Block, State
from ...blocks.held import HeldBlock
from ...blocks.kernel import kernel
from ...blocks.low_pass import held_step
from ...c_form import CForm
from ...inverse_terms import InverseStart, InverseTerms
from ...parameter import Parameter
from ..effect import ChainPosition, Discretisation, Effect
from ..invertibility import Invertibility

UNLIMITED = 1e9
"""Slope that is never reached [V/s]."""
SLOPE = Parameter("S", "S", "V/s", UNLIMITED, 1e-2, UNLIMITED, "largest slope of the drive", "I_max/C", UNLIMITED, 1e3)
"""The largest slope, in all forms of the effect."""


class AmplifierSlewLimitSettling(Effect):
    """The largest slope of an amplifier with one pole, behind a digital-to-analogue converter that holds each value.

    Parameters
    ----------
    S : float
        Largest slope I_max/(C·gain), as drive voltage before the amplifier [V/s]; 1e9 means no limit.
    tau : float
        Time constant of the amplifier while its current is not limited [s]; 0 gives `AmplifierSlewLimit`.

    Notes
    -----
    The output approaches the held value at the slope S until S τ is left, and exponentially after that. A pole and a
    largest slope in series, in either order, have another shape. The block is exact at the ends of the periods; the
    hold itself is a delay of the stage.
    """

    name = "amplifier_slew_limit_settling"
    entry = "amplifier_slew_limit"
    invertibility = Invertibility.APPROXIMATE
    family = "amplifier"
    place = ChainPosition.DRIVE
    equation = "dy/dt = (x − y)/τ, at least −S and at most S"
    signature = "As for amplifier_slew_limit; the end of every ramp is rounded"
    source = "amplifier with one pole and a largest current, behind a zero-order hold"
    parameters = (
        SLOPE,
        Parameter("tau", "τ", "s", 0.0, 0.0, 1e-2, "time constant below the largest slope", "R·C", 0.0, 1e-4),
    )

    def block(self, setting: Discretisation, terms: tuple[Effect, ...] = ()) -> Block:
        return AmplifierSlewLimitSettlingBlock(self["S"], self["tau"], setting.sample_period)


@kernel
def settle(gap, slope, tau, period):
    """The distance `gap` to the held value after one period, and its derivatives by the gap, by S and by τ."""
    side = math.copysign(1.0, gap)
    free = abs(gap) - slope * tau
    if free >= slope * period:
        return gap - side * slope * period, 1.0, -side * period, 0.0
    if not tau > 0.0:
        return 0.0, 0.0, 0.0, 0.0
    if free <= 0.0:
        fade = math.exp(-period / tau)
        return gap * fade, fade, 0.0, gap * fade * period / tau**2
    left = side * slope * tau * math.exp((free / slope - period) / tau)
    turn = abs(gap) / (slope * tau)
    return left, abs(left) / (slope * tau), left * (1.0 - turn) / slope, left * (1.0 + period / tau - turn) / tau


@kernel
def run_settling(x, slope, tau, period, state, y):
    """Follow x (n,), each value held for one period; writes y (n,) and updates state [y]."""
    held = state[0]
    for i in range(x.size):
        held = x[i] + settle(held - x[i], slope, tau, period)[0]
        y[i] = held
    state[0] = held


@kernel
def linearise_settling(x, dx, slope, tau, period, state, tangent, y, dy):
    """`run_settling` and its derivatives: dx (m, n) to dy (m + 2, n), the last rows by S and by τ.

    tangent (m + 2,) is updated.
    """
    m, held = dx.shape[0], state[0]
    for i in range(x.size):
        gap, by_gap, by_slope, by_tau = settle(held - x[i], slope, tau, period)
        held = x[i] + gap
        y[i] = held
        for j in range(m):
            tangent[j] = dx[j, i] + by_gap * (tangent[j] - dx[j, i])
        tangent[m] = by_gap * tangent[m] + by_slope
        tangent[m + 1] = by_gap * tangent[m + 1] + by_tau
        for j in range(m + 2):
            dy[j, i] = tangent[j]
    state[0] = held


STEP = """\
const double gap = s->y - x, side = gap < 0 ? -1.0 : 1.0, free = fabs(gap) - slope * tau;
if (free >= slope * period)
    s->y = x + (gap - side * slope * period);
else if (!(tau > 0))
    s->y = x;
else if (free <= 0)
    s->y = x + gap * exp(-period / tau);
else
    s->y = x + side * slope * tau * exp((free / slope - period) / tau);
return s->y;
"""
"""C code of `run_settling` for one sample."""


class AmplifierSlewLimitSettlingBlock(HeldBlock):
    """y_i = x_i + g, where g is what `settle` leaves of the distance y_(i−1) − x_i."""

    names = ("amplifier_slew_limit_settling.S", "amplifier_slew_limit_settling.tau")
    remembered = 2

    def __init__(self, slope: float, tau: float, sample_period: float) -> None:
        self.slope = slope if slope < UNLIMITED else np.inf
        self.tau, self.sample_period = tau, sample_period

    def follow(self, x: Array, state: State, y: Array) -> None:
        run_settling(x, self.slope, self.tau, self.sample_period, state, y)

    def follow_tangent(self, x: Array, dx: Array, state: State, tangent: State, y: Array, dy: Array) -> None:
        linearise_settling(x, dx, self.slope, self.tau, self.sample_period, state, tangent, y, dy)

    def c_form(self) -> CForm:
        numbers = {"slope": self.slope, "tau": self.tau, "period": self.sample_period}
        return CForm(STEP, "s->y = x;\nreturn x;", numbers, ("double y",))

    def inverse_terms(self) -> InverseTerms:
        """A largest slope and then the pole: the same as long as the slope is not reached."""
        left, lead, back = held_step(self.tau, self.sample_period)[:3]
        return InverseTerms({"reach": self.slope * self.sample_period, "left": left, "lead": lead, "back": back})

    def inverse_start(self, x: float, state: State) -> InverseStart:
        return InverseStart(dict.fromkeys(("slewed", "pole", "held", "pushed"), state[0]))
