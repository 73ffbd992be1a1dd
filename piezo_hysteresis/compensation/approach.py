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

"""The transition from the present position of a stage to the start of a path."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..model.chain import ChainState
from ..model.model import Model
from .limits import Limits

Array = NDArray[np.float64]

APPROACH = 0.05
"""Default duration of the transition [s]."""
FEWEST = 200
"""Fewest samples of a transition. The band makes a shorter one swing below its begin by more than 0.01 % of it."""


def transition_samples(duration: float, sample_period: float) -> int:
    """Number of samples of a transition of this duration [s], at least `FEWEST`; 0 without a transition."""
    return max(round(duration / sample_period), FEWEST) if duration > 0.0 else 0


def settled_start(model: Model, limits: Limits) -> ChainState:
    """State of a stage settled at 0 V, or at the limit that is nearest to it."""
    chain = model.at(model.sample_period)
    return chain.rest(float(np.clip(0.0, limits.voltage_min, limits.voltage_max)))


def smooth_transition(begin: float, end: float, count: int) -> Array:
    """Smooth transition between two levels, shape (count,); the first sample is `begin`."""
    return np.asarray(begin + (end - begin) * (0.5 - 0.5 * np.cos(np.pi * np.arange(count) / max(count, 1))))
