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

"""`Account`: one explanation of the difference between records and a prediction."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

DAY_TO_DAY = {"gain": 0.0075, "loop": 0.04}
"""Standard deviation of the relative changes of gain and loop height from one day to another."""
PENALTY = 0.5
"""Added to V for a gain or loop height that has changed by one such standard deviation."""
FARTHEST = 2.0
"""Largest change from day to day, in these standard deviations. A gain or loop height that differs by more has changed
itself; beside another change it then costs as much as at this limit, however large it is."""


@dataclass(frozen=True, eq=False, slots=True)
class Account:
    """One explanation: its cost, the V that remains, its parameters, and the RMS in floors per unit of each.

    The cost is the remaining V and the penalties. Parameters are in the order of `names`.
    """

    key: str
    cost: float
    left: float
    size: float
    theta: Array
    names: tuple[str, ...]
    scale: Array

    @property
    def own(self) -> dict[str, float]:
        """The parameters by name."""
        return dict(zip(self.names, self.theta.tolist(), strict=True))
