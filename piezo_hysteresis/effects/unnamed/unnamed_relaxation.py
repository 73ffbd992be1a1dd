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

"""A correction without a name that depends on the time since the last motion of the stage."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from ...blocks.block import Array, Block
from ...blocks.relaxation import RelaxationBlock
from ...errors import ParameterError
from ...parameter import Parameter
from ..effect import Discretisation, Effect
from ..invertibility import Invertibility
from ..material.creep import PER_DECADE, settled_mix
from .unnamed_correction import CorrectionShape, UnnamedCorrection


class UnnamedRelaxation(UnnamedCorrection):
    """A small, delayed part of the motion without a physical name.

    Parameters
    ----------
    g_fast, g_slow : float
        Delayed motion per decade of time at ``tau_min`` and at ``tau_max``, relative to the response 0.1 s after a step
        [1/decade]; linear in log τ in between. Not negative, because a stage is passive.
    tau_min, tau_max : float
        Range of the relaxation times [s]: as in `Creep`.
    """

    name = "unnamed_relaxation"
    invertibility = Invertibility.IMPOSSIBLE
    equation = (
        "y = x + Σ_j ½ g_j (x_j − x (1 − e^(−0.1/τ_j))),  τ_j ẋ_j + x_j = x,  g_j = (1 − s_j) g_fast + s_j g_slow"
    )
    signature = "The residual grows with the logarithm of the time since the last change of level"
    source = "log-spaced relaxations under one law"
    depends_on = "time since the last motion"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("g_fast", "g_fast", "1/decade", 0.0, 0.0, 0.05, "late motion, fast end", "fit", 0.0, 0.005),
        Parameter("g_slow", "g_slow", "1/decade", 0.0, 0.0, 0.05, "late motion, slow end", "fit", 0.0, 0.005),
        Parameter("tau_min", "τ_min", "s", 1e-4, 1e-7, 1e3, "fastest relaxation", "records", fixed=True),
        Parameter("tau_max", "τ_max", "s", 1e4, 1e-3, 1e8, "slowest relaxation", "records", fixed=True),
    )

    def check(self) -> None:
        if not self["tau_max"] >= 10.0 * self["tau_min"]:
            raise ParameterError(
                f"{self.name}: got tau_min = {self['tau_min']:g} s, tau_max = {self['tau_max']:g} s, "
                "expected tau_max of at least 10 tau_min"
            )

    def shape(self, displacement_scale: float) -> CorrectionShape:
        tau = np.array([self["tau_min"], self["tau_max"]])
        late = np.array([self["g_fast"], self["g_slow"]])
        return CorrectionShape("relaxation time", "s", tau, "late motion", "1/decade", late)

    def block(self, setting: Discretisation, terms: tuple[Effect, ...] = ()) -> Block:
        decades = np.log10(self["tau_max"] / self["tau_min"])
        place = np.arange(int(PER_DECADE * decades + 1e-9) + 1) / (PER_DECADE * decades)
        tau = self["tau_min"] * 10.0 ** (decades * place)
        slopes: Array = np.vstack([settled_mix(tau, share / PER_DECADE) for share in (1.0 - place, place)])
        names = ("unnamed_relaxation.g_fast", "unnamed_relaxation.g_slow")
        mix = np.array([self["g_fast"], self["g_slow"]]) @ slopes
        return RelaxationBlock(names, tau, setting.sample_period, mix, slopes)
