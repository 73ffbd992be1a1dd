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

"""Dead time beyond the whole samples of the ARX: a fractional delay."""

from __future__ import annotations

import numpy as np

from ...blocks.arx import lagrange
from ...blocks.block import Block
from ...blocks.fir import FirBlock
from ...parameter import Parameter
from ..effect import ChainPosition, Discretisation, Effect
from ..invertibility import Invertibility


class ExtraDelay(Effect):
    """A delay of any length between hysteresis and dynamics.

    Parameters
    ----------
    tau : float
        Dead time [s].

    Notes
    -----
    A delay commutes with every effect that does not depend on absolute time. It is computed after the hysteresis,
    because the loop must receive the levels of the converter and not interpolated levels. The interpolation is a
    third-order Lagrange polynomial at the sample period of the model, and linear in slower records.
    """

    name = "extra_delay"
    invertibility = Invertibility.APPROXIMATE
    family = "lag"
    place = ChainPosition.DYNAMICS
    equation = "y(t) = x(t − τ)"
    signature = (
        "The phase is linear in frequency at every amplitude. If τ is below one sample, it cannot be "
        "separated from the other lags"
    )
    source = "Lagrange interpolation; conversion and transport times"
    parameters = (Parameter("tau", "τ", "s", 0.0, 0.0, 1e-2, "dead time", "converters", 0.0, 2e-5),)

    def block(self, setting: Discretisation, terms: tuple[Effect, ...] = ()) -> Block:
        samples = self["tau"] / setting.sample_period
        if setting.is_slow:
            first = int(samples)
            part = samples - first
            taps, slopes = np.array([1.0 - part, part]), np.array([-1.0, 1.0])
        else:
            first = max(0, int(samples) - 1)
            taps, slopes = lagrange(samples - first - 1.0)
        return FirBlock(("extra_delay.tau",), first, taps, slopes[None, :] / setting.sample_period)
