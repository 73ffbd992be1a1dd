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

"""`Limiter`: the last check of every voltage before the device: range, slew and ramp rate."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from ..errors import StageError
from ..parameter import slew_text
from .description import Description, Samples

LONGEST_PART = 65536
"""Number of samples of a ramp that are computed at once; the next ones are computed while these are played."""


class Limiter:
    """Refuses waveforms outside the limits of a stage, and computes the ramps of the stage itself.

    A stage passes every waveform to its limiter before the device gets it. The ramps lead to a set-point, and to the
    safe voltage after a fault and on closing. A stage starts with the limits of its own description; a driver narrows
    them with `Stage.restrict`.

    Parameters
    ----------
    limits : Description
        Range, steepest slew, safe voltage and longest block.
    ramp_rate : float
        Rate of the stage's own ramps [V/s], at most the steepest slew. If both are infinite, a ramp is one step.
    """

    def __init__(self, limits: Description, ramp_rate: float = math.inf) -> None:
        if not ramp_rate > 0:
            raise StageError(f"{limits.name}: got a ramp rate of {slew_text(ramp_rate)}, expected more than 0")
        self.limits, self.ramp_rate = limits, min(ramp_rate, limits.max_slew_rate)

    def restricted(self, limits: Description, ramp_rate: float) -> Limiter:
        """The limiter of the same stage, restricted to the range and slew of `limits` and to a ramp rate [V/s].

        Raises
        ------
        StageError
            If they allow more than the stage does, or do not contain the safe voltage.
        """
        own = self.limits
        inside = own.voltage_min <= limits.voltage_min and limits.voltage_max <= own.voltage_max
        if not (inside and limits.max_slew_rate <= own.max_slew_rate):
            raise StageError(
                f"{own.name}: got limits {limits.voltage_min:g} to {limits.voltage_max:g} V and "
                f"{slew_text(limits.max_slew_rate)}, expected them inside {own.voltage_min:g} to {own.voltage_max:g} V "
                f"and {slew_text(own.max_slew_rate)}"
            )
        narrowed = replace(
            own,
            voltage_min=limits.voltage_min,
            voltage_max=limits.voltage_max,
            max_slew_rate=limits.max_slew_rate,
        )
        return Limiter(narrowed, ramp_rate)

    @property
    def safe_voltage(self) -> float:
        """Drive voltage of the stage at rest [V]."""
        return self.limits.safe_voltage

    def check(self, voltage: ArrayLike, present_voltage: float, sample_period: float) -> Samples:
        """See `Description.check_voltage`."""
        return self.limits.check_voltage(voltage, present_voltage, sample_period)

    def goal(self, voltage: float) -> float:
        """Return the voltage `goal` [V]; StageError if it is not finite or outside the range."""
        return float(self.limits.check_voltage(np.array([voltage], dtype=np.float64), float(voltage), 1.0)[0])

    def ramp(
        self, present_voltage: float, goal: float, sample_period: float, longest: int = LONGEST_PART
    ) -> Iterator[Samples]:
        """Samples of the straight ramp to a voltage, without the present voltage. The last one is exactly the goal.

        Parameters
        ----------
        present_voltage : float
            Voltage applied now [V]; it may lie outside the limits if another program has left it there.
        goal : float
            Voltage at the end of the ramp [V].
        sample_period : float
            Time between samples [s].
        longest : int
            Largest number of samples in one part.

        Yields
        ------
        (n,) ndarray of float64
            Parts of the ramp. Neighbouring samples differ by at most `ramp_rate` times `sample_period`; there is at
            least one sample.
        """
        step = self.ramp_rate * sample_period
        count = max(math.ceil(abs(goal - present_voltage) / step * (1 - 1e-12)), 1)
        low, high = min(present_voltage, goal), max(present_voltage, goal)
        direction = math.copysign(step, goal - present_voltage) if count > 1 else 0.0
        for first in range(1, count + 1, longest):
            numbers = np.arange(first, min(first + longest, count + 1))
            part = np.clip(present_voltage + direction * numbers, low, high)
            if first + longest > count:
                part[-1] = goal
            yield part
