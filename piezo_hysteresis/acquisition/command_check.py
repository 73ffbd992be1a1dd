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

"""`CommandCheck`: checks a command, which is either played completely or refused completely. No ROS."""

from __future__ import annotations

import math
from dataclasses import dataclass

from ..errors import StageError
from ..stage.stage import Description, Samples


@dataclass(frozen=True, slots=True)
class CommandCheck:
    """The rules by which a driver accepts commands.

    Parameters
    ----------
    limits : Description
        Description of the stage, with the limits of the driver.
    sample_period : float
        Time between samples [s].
    max_age : float
        Largest age of a command that is played, and largest time by which its stamp may be in the future [s].
    """

    limits: Description
    sample_period: float
    max_age: float

    def waveform(self, voltage: Samples, stamp: int, now: int) -> Samples:
        """Check the waveform of a command without its first step, which `first_step` checks.

        Parameters
        ----------
        voltage : (n,) ndarray of float64
            Drive voltage [V].
        stamp : int
            Time at which the command was sent [ns]; 0 switches the check of its age off.
        now : int
            Time on the driver's clock [ns].

        Returns
        -------
        (n,) ndarray of float64
            The waveform [V].

        Raises
        ------
        StageError
            If the command is refused; the message states the reason.
        """
        self._require_drivable()
        age = (now - stamp) / 1e9
        if stamp and abs(age) > self.max_age:
            when = f"{age:.3g} s old" if age > 0 else f"{-age:.3g} s in the future"
            raise StageError(f"stamp is {when}, expected within {self.max_age:g} s; recorded commands move no stage")
        return self.limits.check_voltage(voltage, float(voltage[0]), self.sample_period)

    def first_step(self, waveform: Samples, present_voltage: float) -> None:
        """Raise StageError if a waveform begins too far from the present voltage [V]."""
        self.limits.check_voltage(waveform[:1], present_voltage, self.sample_period)

    def set_point(self, voltage: float) -> float:
        """Check a voltage to ramp to [V], and return it; StageError if it is outside the limits or not finite."""
        self._require_drivable()
        low, high = self.limits.voltage_min, self.limits.voltage_max
        if not (math.isfinite(voltage) and low <= voltage <= high):
            raise StageError(f"got {voltage} V, expected {low:g} to {high:g} V; nothing moves")
        return float(voltage)

    def _require_drivable(self) -> None:
        if self.limits.ignores_drive:
            raise StageError(f"{self.limits.name} replays a recording and cannot be driven")
