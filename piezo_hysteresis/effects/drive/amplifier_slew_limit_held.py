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

"""Largest current of an amplifier whose input a converter holds between samples."""

from __future__ import annotations

import numpy as np

from ...blocks.block import Array, Block, State
from ...blocks.held import HeldBlock
from ...blocks.kernel import kernel
from ...c_form import CForm
from ...inverse_terms import InverseStart, InverseTerms
from ...parameter import Parameter
from ..effect import ChainPosition, Discretisation, Effect
from ..invertibility import Invertibility
from .amplifier_slew_limit_settling import SLOPE, UNLIMITED


class AmplifierSlewLimitHeld(Effect):
    """The largest slope of `AmplifierSlewLimit` behind a digital-to-analogue converter, which holds each value.

    Parameters
    ----------
    S : float
        Largest slope I_max/(C·gain), as drive voltage before the amplifier [V/s]; 1e9 means no limit.
    late : float
        How late a ramp over a whole sample period acts [sample periods]: 0.5 on slow dynamics, 0 on fast ones.

    Notes
    -----
    After every change of the converter by Δ, the amplifier needs the time |Δ|/S. Dynamics that are slower than the
    sample period see the mean over the period (ℓ = 0.5), faster ones the value at its end, which `AmplifierSlewLimit`
    gives (ℓ = 0). Motion that is slower than the limit is late by a time proportional to its speed. In slow records, ℓ
    is in sample periods of the model.
    """

    name = "amplifier_slew_limit_held"
    entry = "amplifier_slew_limit"
    invertibility = Invertibility.APPROXIMATE
    family = "amplifier"
    place = ChainPosition.DRIVE
    equation = "y_i = v_i − ℓ Δ_i |Δ_i|/(S T), Δ_i = v_i − v_(i−1), |Δ_i| ≤ S T"
    signature = "As for amplifier_slew_limit; slower motion is late by a time proportional to its speed"
    source = "mean of a ramp of slope S that ends at the held value: ℓ = 0.5"
    parameters = (
        SLOPE,
        Parameter("late", "ℓ", "1", 0.5, 0.0, 0.5, "lateness of a ramp, in sample periods", "0.5 for its mean"),
    )

    def block(self, setting: Discretisation, terms: tuple[Effect, ...] = ()) -> Block:
        return AmplifierSlewLimitHeldBlock(self["S"], self["late"], setting)


@kernel
def run_ramps(x, reach, late, state, y):
    """Follow x (n,) in ramps of at most `reach` per sample; writes their effect y (n,) and updates state [v].

    A ramp over a whole sample period is late by `late` samples.
    """
    before = state[0]
    for i in range(x.size):
        end = min(max(x[i], before - reach), before + reach)
        move = end - before
        y[i] = end - late * move * abs(move) / reach
        before = end
    state[0] = before


@kernel
def linearise_ramps(x, dx, reach, late, growth, rise, share, state, tangent, y, dy):
    """`run_ramps` and its derivatives: dx (m, n) to dy (m + 2, n), the last rows by S and by the lateness.

    `growth` is ∂reach/∂S, `rise` is −∂(1/reach)/∂S and `share` the factor from the lateness to `late`; tangent (m + 1,)
    is updated.
    """
    m, before = dx.shape[0], state[0]
    for i in range(x.size):
        end = min(max(x[i], before - reach), before + reach)
        move = end - before
        back = 2.0 * late * abs(move) / reach
        y[i] = end - late * move * abs(move) / reach
        for j in range(m + 1):
            old = tangent[j]
            if end == x[i]:
                tangent[j] = dx[j, i] if j < m else 0.0
            elif j == m:
                tangent[j] += growth if move > 0.0 else -growth
            dy[j, i] = tangent[j] - back * (tangent[j] - old)
        dy[m, i] += late * move * abs(move) * rise
        dy[m + 1, i] = -share * move * abs(move) / reach
        before = end
    state[0] = before


class AmplifierSlewLimitHeldBlock(HeldBlock):
    """y_i = v_i − ℓ Δ_i |Δ_i|/(S T), where Δ_i = v_i − v_(i−1), and v_i follows x_i by at most S T.

    The largest slope of the block is 1/(1/S − 1/S_off), so that it is off at the bound S_off without a jump.
    """

    names = ("amplifier_slew_limit_held.S", "amplifier_slew_limit_held.late")

    def __init__(self, slope: float, late: float, setting: Discretisation) -> None:
        part, period = slope / UNLIMITED, setting.sample_period
        self.reach = slope * period / (1.0 - part) if part < 1.0 else np.inf
        self.growth = period / (1.0 - part) ** 2 if part < 1.0 else np.inf
        self.rise = 1.0 / (slope**2 * period)
        self.share = setting.model_period / period
        self.late = late * self.share

    def follow(self, x: Array, state: State, y: Array) -> None:
        run_ramps(x, self.reach, self.late, state, y)

    def follow_tangent(self, x: Array, dx: Array, state: State, tangent: State, y: Array, dy: Array) -> None:
        linearise_ramps(x, dx, self.reach, self.late, self.growth, self.rise, self.share, state, tangent, y, dy)

    def c_form(self) -> CForm:
        step = (
            "const double end = smaller(larger(x, s->v - reach), s->v + reach), move = end - s->v;\n"
            "s->v = end;\nreturn end - late * move * fabs(move) / reach;"
        )
        return CForm(step, "s->v = x;\nreturn x;", {"reach": self.reach, "late": self.late}, ("double v",))

    def inverse_terms(self) -> InverseTerms:
        return InverseTerms({"reach": self.reach})

    def inverse_start(self, x: float, state: State) -> InverseStart:
        return InverseStart(dict.fromkeys(("slewed", "pole", "held", "pushed"), state[0]))
