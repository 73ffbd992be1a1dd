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

"""Slow drift of the stage while it warms up: a function of absolute time."""

from __future__ import annotations

from typing import Self

import numpy as np

from ...blocks.block import Array, Block
from ...blocks.time import TimeBlock
from ...c_form import CForm
from ...parameter import Parameter
from ..effect import ChainPosition, Discretisation, Effect
from ..excitation_need import ExcitationNeed
from ..extent import Extent
from ..invertibility import Invertibility


class ThermalDrift(Effect):
    """The displacement approaches a new zero exponentially with time, for any drive.

    Parameters
    ----------
    D : float
        Final drift [m].
    tau : float
        Time constant [s].

    Notes
    -----
    t is the time since the start of the experiment. If the temperature was recorded, use `ThermalExpansion`.
    """

    name = "thermal_drift"
    invertibility = Invertibility.EXACT
    family = "drift"
    place = ChainPosition.ENVIRONMENT
    excitation_need = ExcitationNeed.REPEATED_PHASE
    equation = "y = x + D (1 − e^(−t/τ))"
    signature = "The residual depends on absolute time only. It is the same in rest phases and under drive"
    source = "first-order warm-up of the stage; 0.1–1 µm/K, 1–60 min"
    parameters = (
        Parameter("D", "D", "m", 0.0, -1e-4, 1e-4, "final drift", "first-order warm-up", 0.0, 1e-7),
        Parameter("tau", "τ", "s", 600.0, 1.0, 1e5, "time constant of the warm-up", "first-order warm-up", scale=300.0),
    )

    @classmethod
    def starts(cls, extent: Extent) -> tuple[Self, ...]:
        return tuple(cls(tau=max(1.0, share * extent.duration)) for share in (0.1, 0.4, 1.5))

    def block(self, setting: Discretisation, terms: tuple[Effect, ...] = ()) -> Block:
        return ThermalDriftBlock(self["D"], self["tau"], setting.sample_period)


class ThermalDriftBlock(TimeBlock):
    """x + D (1 − e^(−t/τ))."""

    names = ("thermal_drift.D", "thermal_drift.tau")

    def __init__(self, drift: float, tau: float, sample_period: float) -> None:
        super().__init__(sample_period)
        self.drift, self.tau = drift, tau

    def value(self, x: Array, t: Array) -> Array:
        return x - self.drift * np.expm1(-t / self.tau)

    def by_parameter(self, x: Array, t: Array) -> Array:
        return np.vstack((-np.expm1(-t / self.tau), -self.drift * t / self.tau**2 * np.exp(-t / self.tau)))

    def c_form(self) -> CForm:
        return self.value_in_c("return x - D * expm1(-t / tau);", D=self.drift, tau=self.tau)
