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

"""Bandwidth of an amplifier whose input a converter holds between samples."""

from __future__ import annotations

from ...blocks.block import Block
from ...blocks.low_pass import LowPassBlock, PoleStep, held_lag, held_step, linear_step
from ..effect import Discretisation, Effect
from ..invertibility import Invertibility
from .amplifier_bandwidth import AmplifierBandwidth


class AmplifierBandwidthHeld(AmplifierBandwidth):
    """The pole of `AmplifierBandwidth` after a digital-to-analogue converter, which holds each value of the drive.

    Parameters
    ----------
    tau : float
        Time constant R·C of output resistance and actuator capacitance [s].

    Notes
    -----
    The actuator reaches its turning points at the ends of the periods of the converter. The block computes the output
    of the pole at these instants; the hold itself is a delay of the stage. In slow records the drive is taken as linear
    between samples, and the pole is replaced by one with the time constant T/(e^(T/τ) − 1), which has the same lag; T
    is the sample period of the model.
    """

    name = "amplifier_bandwidth_held"
    entry = "amplifier_bandwidth"
    invertibility = Invertibility.EXACT
    equation = "y_i = e^(−T/τ) y_(i−1) + (1 − e^(−T/τ)) x_i"
    signature = (
        "As for amplifier_bandwidth. The two differ within one sample, and only before a backlash or a hysteresis loop"
    )
    source = "zero-order hold of the converter before R·C; Franklin, Powell, Workman 1998, Sec. 4.3"

    def lag(self, sample_period: float) -> tuple[float, float]:
        return held_lag(self["tau"], sample_period)

    def block(self, setting: Discretisation, terms: tuple[Effect, ...] = ()) -> Block:
        return LowPassBlock("amplifier_bandwidth_held.tau", self._step(setting))

    def _step(self, setting: Discretisation) -> PoleStep:
        if not setting.is_slow:
            return held_step(self["tau"], setting.sample_period)
        lag, slope = held_lag(self["tau"], setting.model_period)
        step = linear_step(lag, setting.sample_period)
        left_slope, lead_slope, back_slope = (slope * value for value in step[3:])
        return PoleStep(*step[:3], left_slope, lead_slope, back_slope)
