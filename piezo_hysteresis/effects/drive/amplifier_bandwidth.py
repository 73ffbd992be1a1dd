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

"""Bandwidth of the amplifier into the capacitance of the actuator."""

from __future__ import annotations

from typing import Self

from ...blocks.block import Block
from ...blocks.low_pass import LowPassBlock, linear_step
from ...parameter import Parameter
from ..effect import ChainPosition, Discretisation, Effect
from ..extent import Extent
from ..invertibility import Invertibility

START_VALUES = (1e-5, 2e-5, 5e-5, 1.5e-4)
"""Start values of the time constant [s]."""


class AmplifierBandwidth(Effect):
    """The amplifier acts as one first-order pole before the hysteresis.

    Parameters
    ----------
    tau : float
        Time constant R·C of output resistance and actuator capacitance [s].
    """

    name = "amplifier_bandwidth"
    invertibility = Invertibility.EXACT
    family = "lag"
    place = ChainPosition.DRIVE
    equation = "τ ẏ + y = x"
    signature = (
        "The lag grows with frequency at every amplitude. If τ is below one sample, it cannot be separated "
        "from the other lags"
    )
    source = "R·C of amplifier and actuator, 15–60 µs"
    parameters = (Parameter("tau", "τ", "s", 0.0, 0.0, 10.0, "time constant R·C", "R·C", 0.0, 2e-5),)

    @classmethod
    def starts(cls, extent: Extent) -> tuple[Self, ...]:
        """Off, and several sizes, because the system after the pole is not linear."""
        return cls(), *(cls(tau=tau) for tau in START_VALUES)

    def lag(self, sample_period: float) -> tuple[float, float]:
        """Time by which samples of a slow signal are later behind the pole [s], and its derivative by τ [1]."""
        return self["tau"], 1.0

    def block(self, setting: Discretisation, terms: tuple[Effect, ...] = ()) -> Block:
        return LowPassBlock("amplifier_bandwidth.tau", linear_step(self["tau"], setting.sample_period))
