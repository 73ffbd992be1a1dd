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

"""`Limits`: limits of the drive while a path is followed."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from ..errors import StageError

RESOLUTION = 5e-5
"""Default resolution of a plan, as a share of the range of the drive: 0.5 mV for 10 V."""


@dataclass(frozen=True, slots=True)
class Limits:
    """Range and slope of the drive voltage.

    Parameters
    ----------
    voltage_min, voltage_max : float
        Range of the drive before the amplifier [V].
    max_slew_rate : float
        Largest rate of change between two samples [V/s].
    resolution : float
        Voltage changes up to this size do not reverse a backlash [V]. A reversal needs a jump by the full width of the
        backlash. Without a resolution, the rounding errors of a constant path would cause such jumps. Default: 0 for an
        `Inverse`, and 0.005 % of the range for a plan if the range is finite.

    Raises
    ------
    StageError
        If the limits contradict one another.
    """

    voltage_min: float = -math.inf
    voltage_max: float = math.inf
    max_slew_rate: float = math.inf
    resolution: float | None = None

    def __post_init__(self) -> None:
        if not self.voltage_min < self.voltage_max:
            raise StageError(
                f"voltage limits: got {self.voltage_min:g} to {self.voltage_max:g} V, "
                "expected a minimum below the maximum"
            )
        if not self.max_slew_rate > 0:
            raise StageError(f"max_slew_rate: got {self.max_slew_rate!r}, expected a positive number of V/s")
        if self.resolution is not None and not 0.0 <= self.resolution < math.inf:
            raise StageError(f"resolution: got {self.resolution!r}, expected zero or a positive number of V")

    @property
    def resolved(self) -> Limits:
        """The same limits with a resolution: the given one, or `RESOLUTION` times the range if the range is finite."""
        span = self.voltage_max - self.voltage_min
        if self.resolution is not None or not math.isfinite(span):
            return self
        return replace(self, resolution=RESOLUTION * span)
