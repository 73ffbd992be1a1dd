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

"""Second-order low-pass filter of the sensor."""

from __future__ import annotations

import numpy as np

from ...blocks.block import Array, Block, State
from ...blocks.fir import FirBlock
from ...parameter import Parameter
from ..dynamics.extra_resonance import RESOLVED, ModeBlock
from ..effect import ChainPosition, Discretisation, Effect
from ..invertibility import Invertibility

BUTTERWORTH = 0.5**0.5
"""Damping ratio of a Butterworth filter, whose gain is maximally flat in the pass band."""


class SecondOrderLowPass(Effect):
    """A second-order filter, such as an anti-aliasing filter, before the converter of the sensor.

    Parameters
    ----------
    tau : float
        Time constant 1/(2π·natural frequency) [s]; for Butterworth, this is the cut-off frequency (−3 dB).
    zeta : float
        Damping ratio [1].

    Notes
    -----
    The block is exact for an input that is linear between samples. A filter with a natural frequency above 0.45 cycles
    per sample is replaced by a delay of 2 ζ τ.
    """

    name = "second_order_low_pass"
    invertibility = Invertibility.EXACT
    family = "lag"
    place = ChainPosition.SENSOR
    equation = "Y/X = 1/(1 + 2 ζ τ s + τ² s²)"
    signature = "The whole measurement lags and rolls off; the response to a step starts with zero slope"
    source = "anti-aliasing filters: Butterworth, ζ = 0.7071"
    parameters = (
        Parameter("tau", "τ", "s", 0.0, 0.0, 10.0, "time constant of the filter", "filter settings", 0.0, 2e-5),
        Parameter("zeta", "ζ", "1", BUTTERWORTH, 0.3, 1.0, "damping ratio of the filter", "Butterworth", fixed=True),
    )

    def block(self, setting: Discretisation, terms: tuple[Effect, ...] = ()) -> Block:
        tau, zeta, period = self["tau"], self["zeta"], setting.sample_period
        if period <= 2.0 * np.pi * RESOLVED * tau:
            return SecondOrderBlock(tau, zeta, period)
        lag = 2.0 * zeta / period
        taps = np.array([1.0 - lag * tau, lag * tau])
        return FirBlock(("second_order_low_pass.tau",), 0, taps, np.array([[-lag, lag]]))


class SecondOrderBlock(ModeBlock):
    """The filter as a `ModeBlock` whose share of the static response is 1."""

    names = ("second_order_low_pass.tau",)

    def __init__(self, tau: float, zeta: float, sample_period: float) -> None:
        super().__init__(1.0, 1.0 / (2.0 * np.pi * tau), zeta, sample_period)
        self.by_tau = -1.0 / (2.0 * np.pi * tau**2)

    def by_parameter(self, x: Array, y: Array, z: Array, own: State, rows: Array) -> State:
        both = np.empty((3, x.size))
        own = super().by_parameter(x, y, z, own, both)
        rows[0] = self.by_tau * both[1]
        return own
