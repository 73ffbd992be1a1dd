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

"""`Clock`: how one hold interval of the converter is cut into the sub-steps of the plant.

The plant is time-invariant from converter to displacement, so its dead time can be applied first. The plant then runs
on a time axis that is shifted by the dead time: the hold begins at one sub-step, and the reading coincides with another
one. A dead time of any length is exact in this way, without interpolation.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class Clock:
    """Sub-steps of one sample.

    Parameters
    ----------
    sample_period : float
        Time between samples [s].
    holds : int
        Whole sample periods that pass before a new voltage begins to act.
    before, after : int
        Number of sub-steps of the hold interval before and after the reading.
    step_before, step_after : float
        Duration of one sub-step before and after the reading [s].
    """

    sample_period: float
    holds: int
    before: int
    after: int
    step_before: float
    step_after: float

    @classmethod
    def cut(cls, sample_period: float, dead_time: float, longest: float) -> Clock:
        """Cut the hold interval at the reading, and both parts into equal sub-steps of at most `longest` [s]."""
        holds = math.ceil(dead_time / sample_period - 1e-9)
        first = holds * sample_period - dead_time
        if first < 1e-9 * sample_period:  # a whole number of samples: the reading stands at the start of the hold
            first = 0.0
        rest = sample_period - first
        before, after = math.ceil(first / longest), math.ceil(rest / longest)
        return cls(sample_period, holds, before, after, first / before if before else longest, rest / after)

    @property
    def count(self) -> int:
        """Sub-steps per sample."""
        return self.before + self.after

    @property
    def steps(self) -> tuple[float, float]:
        """Duration of a sub-step before and after the reading [s]."""
        return self.step_before, self.step_after

    @property
    def kind(self) -> NDArray[np.int64]:
        """0 for every sub-step before the reading, 1 for every one after it, shape (count,)."""
        return np.repeat(np.array([0, 1]), [self.before, self.after]).astype(np.int64)
