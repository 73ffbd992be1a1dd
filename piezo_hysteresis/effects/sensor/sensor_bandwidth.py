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

"""Low-pass of the displacement sensor."""

from __future__ import annotations

from ...blocks.block import Block
from ...blocks.low_pass import LowPassBlock, linear_step
from ...errors import ParameterError
from ...parameter import Parameter
from ..effect import ChainPosition, Discretisation, Effect
from ..invertibility import Invertibility


class SensorBandwidth(Effect):
    """The sensor acts as one or several equal first-order poles.

    Parameters
    ----------
    tau : float
        Time constant of each pole, 1/(2π·cut-off frequency) [s].
    poles : float
        Number of poles, a whole number [1].
    """

    name = "sensor_bandwidth"
    invertibility = Invertibility.EXACT
    family = "lag"
    place = ChainPosition.SENSOR
    equation = "Y/X = 1/(1 + τ s)^n"
    signature = (
        "The whole measurement lags and rolls off. If τ is below one sample, it cannot be separated from other lags"
    )
    source = "bandwidth settings of capacitive sensors: 50 Hz, 500 Hz, 5 kHz"
    parameters = (
        Parameter("tau", "τ", "s", 0.0, 0.0, 10.0, "time constant of each pole", "sensor settings", 0.0, 2e-5),
        Parameter("poles", "n", "1", 1.0, 1.0, 8.0, "number of poles", "sensor settings", fixed=True),
    )

    def check(self) -> None:
        if self["poles"] != int(self["poles"]):
            raise ParameterError(f"sensor_bandwidth.poles: got {self['poles']:g}, expected a whole number")

    def block(self, setting: Discretisation, terms: tuple[Effect, ...] = ()) -> Block:
        step = linear_step(self["tau"], setting.sample_period)
        return LowPassBlock("sensor_bandwidth.tau", step, int(self["poles"]))
