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

"""Motion of the other axis in the measurement of this axis."""

from __future__ import annotations

import numpy as np

from ...blocks.block import Array, Block
from ...blocks.channel_addition import ChannelBlock
from ...c_form import CForm
from ...parameter import Parameter
from ..effect import ChainPosition, Discretisation, Effect
from ..invertibility import Invertibility


class AxisCoupling(Effect):
    """The sensor of this axis also measures a part of the other axis' displacement.

    Parameters
    ----------
    kappa0 : float
        Coupling at the origin of the other axis [1].
    kappa1 : float
        Change of the coupling with the position of the other axis [1/m].

    Notes
    -----
    Needs the channel ``other_displacement`` q [m]; without it nothing is added.
    """

    name = "axis_coupling"
    invertibility = Invertibility.NOT_NEEDED
    family = "disturbance"
    place = ChainPosition.ENVIRONMENT
    channel = "other_displacement"
    equation = "y = x + (κ0 + κ1 q) q"
    signature = "The residual is coherent with the displacement of the other axis, for any drive of this axis"
    source = "cross-coupling of XY stages; 0.5–1.2 % of the other axis' motion"
    parameters = (
        Parameter("kappa0", "κ0", "1", 0.0, -0.5, 0.5, "coupling at the origin", "XY stages", 0.0, 0.01),
        Parameter("kappa1", "κ1", "1/m", 0.0, -1e5, 1e5, "change of coupling with position", "XY stages", 0.0, 100.0),
    )

    def block(self, setting: Discretisation, terms: tuple[Effect, ...] = ()) -> Block:
        return AxisCouplingBlock(self["kappa0"], self["kappa1"])


class AxisCouplingBlock(ChannelBlock):
    """x + (κ0 + κ1 q) q."""

    names = ("axis_coupling.kappa0", "axis_coupling.kappa1")
    channel = "other_displacement"

    def __init__(self, kappa0: float, kappa1: float) -> None:
        self.kappa0, self.kappa1 = kappa0, kappa1

    def addition(self, c: Array) -> Array:
        return (self.kappa0 + self.kappa1 * c) * c

    def by_parameter(self, c: Array) -> Array:
        return np.vstack((c, c * c))

    def c_form(self) -> CForm:
        q = self.channel
        return self.added_in_c(f"(kappa0 + kappa1 * {q}) * {q}", kappa0=self.kappa0, kappa1=self.kappa1)
