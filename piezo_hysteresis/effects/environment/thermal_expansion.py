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

"""Thermal expansion of the stage, for records with temperature."""

from __future__ import annotations

from typing import Self

import numpy as np

from ...blocks.block import Array, Block
from ...blocks.channel_addition import ChannelBlock
from ...c_form import CForm
from ...parameter import Parameter
from ..effect import ChainPosition, Discretisation, Effect
from ..extent import Extent
from ..invertibility import Invertibility


class ThermalExpansion(Effect):
    """A displacement proportional to the recorded temperature.

    Parameters
    ----------
    kappa : float
        Expansion between sensor and stage [m/K].
    T0 : float
        Temperature at which the expansion is zero [K].

    Notes
    -----
    Needs the channel ``temperature``; without it nothing is added.
    """

    name = "thermal_expansion"
    invertibility = Invertibility.NOT_NEEDED
    entry = "thermal_drift"
    family = "drift"
    place = ChainPosition.ENVIRONMENT
    channel = "temperature"
    equation = "y = x + κ (T − T0)"
    signature = "The residual follows the temperature, for any drive"
    source = "linear expansion; 0.1–1 µm/K"
    parameters = (
        Parameter("kappa", "κ", "m/K", 0.0, -1e-4, 1e-4, "expansion between sensor and stage", "expansion", 0.0, 1e-7),
        Parameter(
            "T0", "T0", "K", 293.15, 0.0, 1e3, "reference temperature", "convention, 20 °C", scale=10.0, fixed=True
        ),
    )

    @classmethod
    def starts(cls, extent: Extent) -> tuple[Self, ...]:
        """Switched off, with T0 at the mean temperature; with another T0, expansion and sensor zero are correlated."""
        return (cls(T0=extent.temperature),)

    def block(self, setting: Discretisation, terms: tuple[Effect, ...] = ()) -> Block:
        return ThermalExpansionBlock(self["kappa"], self["T0"])


class ThermalExpansionBlock(ChannelBlock):
    """x + κ (T − T0)."""

    names = ("thermal_expansion.kappa",)
    channel = "temperature"

    def __init__(self, kappa: float, reference: float) -> None:
        self.kappa, self.reference = kappa, reference

    def addition(self, c: Array) -> Array:
        return self.kappa * (c - self.reference)

    def by_parameter(self, c: Array) -> Array:
        return np.array([c - self.reference])

    def c_form(self) -> CForm:
        return self.added_in_c(f"kappa * ({self.channel} - T0)", kappa=self.kappa, T0=self.reference)
