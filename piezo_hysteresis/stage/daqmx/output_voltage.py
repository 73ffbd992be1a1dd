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

"""`OutputVoltage`: the drive voltage at which the output of a card stands."""

from __future__ import annotations

import numpy as np

from ..stage import Description, Samples
from .daqmx_error import DaqmxError
from .setup import DaqmxSetup
from .tasks import Tasks

_READ_BACK_ERROR = 2e-3
"""Largest error of an output that the card reads back itself [V]."""


class OutputVoltage:
    """Reads the output back, or measures it with the monitor; no stream may be running.

    Parameters
    ----------
    setup : DaqmxSetup
        Wiring and scales.
    tasks : Tasks
        Connection to the card.
    description : Description
        Limits of the drive.
    """

    def __init__(self, setup: DaqmxSetup, tasks: Tasks, description: Description) -> None:
        self._setup, self._tasks, self._description = setup, tasks, description

    def measured(self, readings: Samples) -> Samples:
        """Drive voltage from the monitor [V], for readings of all inputs."""
        return np.asarray(readings[1] / (self._setup.monitor_gain * self._setup.amplifier_gain))

    def found(self) -> float | None:
        """The voltage [V]; None if neither card nor monitor reports it.

        One that cannot be told from the safe voltage, or from one inside the limits, counts as that.
        """
        found, uncertainty = self._tasks.output(), _READ_BACK_ERROR
        if found is None:
            if not self._setup.voltage_input:
                return None
            found = float(self.measured(self._tasks.read_once()).ravel()[0])
            uncertainty = self._monitor_error
        d = self._description
        known = (d.safe_voltage, min(max(found, d.voltage_min), d.voltage_max))
        near = next((voltage for voltage in known if abs(found - voltage) <= uncertainty), found)
        self._tasks.include(near)
        return near

    def here(self) -> float:
        """The voltage [V], or without a report the last one that was certainly put out; DaqmxError without either."""
        reported = self.found()
        found = self._tasks.last_written if reported is None else reported
        if found is None:
            raise DaqmxError(f"{self._description.name}: neither the card nor a monitor reports the output")
        return found

    def require(self, expected: float) -> None:
        """DaqmxError if another program has moved the output from a voltage [V]; a motion from there would be a step.

        Without a report the output counts as unmoved.
        """
        found = self.found()
        if found is not None and abs(found - expected) > max(_READ_BACK_ERROR, self._monitor_error):
            raise DaqmxError(
                f"{self._description.name}: the output is at {found:g} V, expected {expected:g} V, where this "
                "driver left it; end the other program that moves it"
            )

    @property
    def _monitor_error(self) -> float:
        """Largest error of the monitor, in drive voltage [V]; 0 without one."""
        s = self._setup
        return s.voltage_tolerance / abs(s.amplifier_gain) if s.voltage_input else 0.0
