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
"""Largest distance from the safe voltage at which an output that the card reads back counts as safe [V]."""
_ZERO_ERROR, _GAIN_ERROR = 2e-2, 2e-3
"""Largest errors of output and read-back together [V], [1]; several times those of a card that was calibrated."""


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

        One that cannot be told from the safe voltage, or from one inside the limits, counts as that. A monitor may be
        wrong or not connected: only the card itself is believed that its output is outside the limits.
        """
        d, reported = self._description, self._tasks.output()
        if reported is not None:
            inside = min(max(reported, d.voltage_min), d.voltage_max)
            if abs(reported - d.safe_voltage) <= _READ_BACK_ERROR:
                return d.safe_voltage
            if abs(reported - inside) <= _tolerance(inside):
                return inside
            self._tasks.include(reported)
            return reported
        if not self._setup.voltage_input:
            return None
        measured = float(self.measured(self._tasks.read_once()).ravel()[0])
        if abs(measured - d.safe_voltage) <= self._setup.voltage_tolerance / abs(self._setup.amplifier_gain):
            return d.safe_voltage
        return min(max(measured, d.voltage_min), d.voltage_max)

    def here(self) -> float:
        """The voltage [V], or without a report the last one that was certainly put out; DaqmxError without either."""
        reported = self.found()
        found = self._tasks.last_written if reported is None else reported
        if found is None:
            raise DaqmxError(f"{self._description.name}: neither the card nor a monitor reports the output")
        return found

    def require(self, expected: float) -> None:
        """DaqmxError if another program has moved the output from a voltage [V]; a motion from there would be a step.

        Without a report of the card itself the output counts as unmoved.
        """
        found = self.now(expected)
        if found != expected:
            raise DaqmxError(
                f"{self._description.name}: the output is at {found:g} V, expected {expected:g} V, where this "
                "driver left it; end the other program that moves it"
            )

    def now(self, expected: float) -> float:
        """The voltage [V] of an output that was left at `expected`: that, unless the card itself reports another."""
        reported = self._tasks.output()
        if reported is None or abs(reported - expected) <= _tolerance(expected):
            return expected
        self._tasks.include(reported)
        return reported


def _tolerance(voltage: float) -> float:
    """Largest distance of the read-back from a voltage at which the output stands [V]: errors of output and input."""
    return _ZERO_ERROR + _GAIN_ERROR * abs(voltage)
