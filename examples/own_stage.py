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

"""A back end for a device of your own: everything that the driver needs, from two functions.

`put(volts)` sets the drive, and `get()` reads the sensor in metres. The clock of this machine sets the pace, for sample
periods of a millisecond or more. Back ends of devices with a clock or a memory are written in the same way:
`stage/daqmx/stage.py` streams on a hardware clock, and `stage/gcs2/stage.py` uploads, plays and reads back.
"""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np

from piezo_hysteresis.errors import StageError
from piezo_hysteresis.stage.limiter import Limiter
from piezo_hysteresis.stage.simulated import SimulatedStage
from piezo_hysteresis.stage.stage import Acquired, Description, Samples


class OwnStage:
    """A streaming stage, sample by sample.

    Parameters
    ----------
    name : str
        Model and serial number: one driver per name.
    put : callable
        Sets the drive voltage [V].
    get : callable
        Reads the displacement [m].
    voltage_max : float
        Highest drive voltage [V]; the lowest, and the safe one, is 0.
    max_slew_rate : float
        Steepest drive [V/s].
    """

    def __init__(
        self,
        name: str,
        put: Callable[[float], None],
        get: Callable[[], float],
        voltage_max: float,
        max_slew_rate: float,
    ) -> None:
        # 1. Describe the device and its limits; everything outside them is refused before anything moves.
        self._description = Description(
            name=name,
            streaming=True,
            sample_period_min=1e-3,
            sample_period_max=1.0,
            voltage_min=0.0,
            voltage_max=voltage_max,
            max_slew_rate=max_slew_rate,
        )
        self._limiter = Limiter(self._description)
        self._put, self._get = put, get
        self._sample_period, self._voltage, self._due, self._moved, self._closed = 1e-3, 0.0, 0.0, 0.0, False

    @property
    def description(self) -> Description:
        """Limits and kind of the device."""
        return self._description

    @property
    def sample_period(self) -> float:
        """Present sample period [s]."""
        return self._sample_period

    @property
    def voltage(self) -> float:
        """Present drive voltage [V]."""
        return self._voltage

    def configure(self, sample_period: float) -> None:
        """Set the sample period [s]."""
        self._require_open()
        self._sample_period = self._description.check_sample_period(sample_period)

    def restrict(self, limits: Description, ramp_rate: float) -> None:
        """Use the limits of the driver from now on; every voltage passes the limiter before it leaves this machine."""
        self._limiter = Limiter(self._description).restricted(limits, ramp_rate)

    # 2. The fast path returns as many samples as were given, each measured while its voltage was applied. If the device
    #    fails meanwhile, raise StageError; the driver then calls `safe`.
    def exchange(self, voltage: Samples) -> Acquired:
        """Apply a block of drive voltages [V], one per sample period."""
        self._require_open()
        drive = self._limiter.check(voltage, self._voltage, self._sample_period)
        displacement = np.empty(drive.size)
        self._due = max(self._due, time.monotonic())
        for i, level in enumerate(drive):
            self._move(float(level))
            self._due += self._sample_period
            time.sleep(max(self._due - time.monotonic(), 0.0))
            displacement[i] = self._get()
        return Acquired(drive, displacement)

    # 3. The slow path.
    def set_voltage(self, voltage: float) -> None:
        """Go to one voltage [V] and hold it."""
        self._require_open()
        self._go(self._limiter.goal(voltage))

    def read_voltage(self) -> float:
        """The present voltage [V]; it is not measured here."""
        return self._voltage

    def read_displacement(self) -> float:
        """One reading [m]."""
        self._require_open()
        return self._get()

    # 4. The way to the safe voltage may be repeated, and must work in every state. If it fails, raise StageError and
    #    state what is known about the voltage.
    def safe(self) -> None:
        """Go to 0 V."""
        if not self._closed and self._voltage != self._limiter.safe_voltage:
            self._go(self._limiter.safe_voltage)

    def close(self) -> None:
        """Make safe; every later call but `close` and `safe` raises StageError."""
        self.safe()
        self.leave()

    def leave(self) -> None:
        """Release the device without moving it, because another program drives it."""
        self._closed = True

    def _go(self, voltage: float) -> None:
        for part in self._limiter.ramp(self._voltage, voltage, 1e-3):
            for level in part:
                self._move(float(level))
                time.sleep(1e-3)

    # After a delay `exchange` catches up. Many samples at once would be a step: the slew limit holds in real time, too.
    def _move(self, voltage: float) -> None:
        fastest = abs(voltage - self._voltage) / self._limiter.limits.max_slew_rate
        time.sleep(max(self._moved + fastest - time.monotonic(), 0.0))
        self._put(voltage)
        self._voltage, self._moved = voltage, time.monotonic()

    def _require_open(self) -> None:
        if self._closed:
            raise StageError(f"{self._description.name}: is closed, expected an open stage; make a new one")


if __name__ == "__main__":
    device = SimulatedStage(sample_period=1e-3)  # in place of yours
    stage = OwnStage("bench 3", device.set_voltage, device.read_displacement, voltage_max=10.0, max_slew_rate=2000.0)
    record = stage.exchange(np.linspace(0.0, 5.0, 50))
    stage.close()
    print(
        f"{record.voltage.size} samples, {1e6 * np.ptp(record.displacement):.1f} µm, {device.voltage:.0f} V at the end"
    )
