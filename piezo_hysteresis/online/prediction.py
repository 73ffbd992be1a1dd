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

"""`Prediction`: prediction and residual of one block of samples."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..errors import PiezoError
from ..model.model import Model
from .sensor_offset import SensorOffset

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False, slots=True)
class Prediction:
    """Prediction and residual of one block.

    Parameters
    ----------
    first : int
        Position of the first new sample in the block; the samples before it had been received already.
    prediction, residual : (n,) ndarray
        Predicted displacement, and measured minus predicted [m], of the samples from `first` on; empty without a model.
    model : Model or None
        Model that computed them.
    warming_up : bool
        True while voltages that were not received (before the first block, in a gap) influence the prediction.
    zeroing : (SensorOffset, int)
        Measurement of the sensor offset, and its samples so far; the offset is the same while it is.
    refused : PiezoError or None
        Why a new model was dropped after this block, before it could replace the present one.
    """

    first: int
    prediction: Array
    residual: Array
    model: Model | None
    warming_up: bool
    zeroing: tuple[SensorOffset, int]
    refused: PiezoError | None = None
