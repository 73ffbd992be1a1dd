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

"""Change of the gain of actuator and sensor while they warm up."""

from __future__ import annotations

from typing import Self

import numpy as np

from ...blocks.block import Array, Block, State
from ...blocks.inverses.inverted_block import InvertedBlock
from ...blocks.time import TimeBlock, at_time
from ...c_form import CForm
from ...parameter import Parameter
from ..effect import ChainPosition, Discretisation, Effect
from ..excitation_need import ExcitationNeed
from ..extent import Extent
from ..invertibility import Invertibility


class GainDrift(Effect):
    """The gain approaches a new value exponentially with absolute time.

    Parameters
    ----------
    g : float
        Final relative change of gain [1].
    tau : float
        Time constant [s].

    Notes
    -----
    t is the time since the start of the experiment. The gain acts on the normalised position, before the sensor zero.
    """

    name = "gain_drift"
    invertibility = Invertibility.EXACT
    family = "drift"
    place = ChainPosition.SENSOR
    excitation_need = ExcitationNeed.REPEATED_PHASE
    equation = "y = x [1 + g (1 − e^(−t/τ))]"
    signature = (
        "The residual is proportional to the displacement and grows with time. Repeat the first triangle at "
        "the end to see it"
    )
    source = "first-order warm-up; 0.05–0.5 %/K"
    parameters = (
        Parameter("g", "g", "1", 0.0, -0.5, 0.5, "final relative change of gain", "first-order warm-up", 0.0, 0.01),
        Parameter("tau", "τ", "s", 600.0, 1.0, 1e5, "time constant of the warm-up", "first-order warm-up", scale=300.0),
    )

    @classmethod
    def starts(cls, extent: Extent) -> tuple[Self, ...]:
        return tuple(cls(tau=max(1.0, share * extent.duration)) for share in (0.1, 0.4, 1.5))

    def block(self, setting: Discretisation, terms: tuple[Effect, ...] = ()) -> Block:
        return GainDriftBlock(self["g"], self["tau"], setting.sample_period)


class GainDriftBlock(TimeBlock):
    """x (1 + g (1 − e^(−t/τ)))."""

    names = ("gain_drift.g", "gain_drift.tau")

    def __init__(self, change: float, tau: float, sample_period: float) -> None:
        super().__init__(sample_period)
        self.change, self.tau = change, tau

    def slope(self, x: Array, t: Array) -> Array:
        return 1.0 - self.change * np.expm1(-t / self.tau)

    def value(self, x: Array, t: Array) -> Array:
        return x * self.slope(x, t)

    def static_at(self, x0: float, time: float) -> float:
        return x0 * float(self.slope(np.array([x0]), np.array([time]))[0])

    def static_slopes_at(self, x0: float, time: float) -> tuple[float, Array]:
        x, at = np.array([x0]), np.array([time])
        return float(self.slope(x, at)[0]), self.by_parameter(x, at)[:, 0]

    def by_parameter(self, x: Array, t: Array) -> Array:
        return x * np.vstack((-np.expm1(-t / self.tau), -self.change * t / self.tau**2 * np.exp(-t / self.tau)))

    def c_form(self) -> CForm:
        return self.value_in_c("return x * (1.0 - g * expm1(-t / tau));", g=self.change, tau=self.tau)

    def inverted(self, name: str) -> InvertedBlock:
        return InvertedGainDrift(self)


class InvertedGainDrift(InvertedBlock):
    """y = x · g(t)."""

    def __init__(self, block: GainDriftBlock) -> None:
        self.block = block

    def run(self, y: Array, state: State, time: Array) -> tuple[Array, State]:
        return y / self.block.slope(y, time), None

    def c_form(self, ahead: int) -> CForm | str:
        return at_time("return x / ME_forward_step(&s->forward, 1.0);", self.block, ahead)
