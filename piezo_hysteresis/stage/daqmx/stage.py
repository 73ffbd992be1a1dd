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

"""`DaqmxStage`: a stage on a National Instruments card, streamed."""

from __future__ import annotations

from contextlib import AbstractContextManager, suppress
from dataclasses import replace

import numpy as np

from ...errors import DeviceError, StageError, UnknownVoltageError
from ..agreement import Agreement
from ..guard import guarded
from ..limiter import Limiter
from ..stage import Acquired, Description, Samples
from .daqmx_error import DaqmxError
from .output_voltage import OutputVoltage
from .setup import DaqmxSetup
from .tasks import Tasks

_RAMP_PERIOD = 1e-3
"""Longest time between the samples of a ramp outside a stream [s]."""
_CLIPPED = 0.998
"""Share of the range of the sensor from which a sample counts as clipped."""


class DaqmxStage:
    """A streaming stage: output and input on one hardware clock, without regeneration.

    A block waits in the output buffer for `DaqmxSetup.lead`. `exchange` returns the samples that were applied and
    measured `Description.latency` before. A block that comes too late ends the stream with an error.

    Parameters
    ----------
    setup : DaqmxSetup

    Raises
    ------
    StageError
        If NI-DAQmx, the server or the card is missing, or the voltage at the output is unknown.
    """

    def __init__(self, setup: DaqmxSetup) -> None:
        self._setup, self._tasks, self._closed, self._is_lost = setup, Tasks(setup), False, False
        self._description = setup.description()
        self._output = OutputVoltage(setup, self._tasks, self._description)
        self._limiter = Limiter(self._description)
        self._description.check_sample_period(setup.sample_period)
        self._voltage = self._description.safe_voltage
        self._waiting: Samples = np.empty(0)
        self._readings: Samples = np.empty(0)
        self._agreement = self._new_agreement()
        try:
            self._tasks.read_once()  # a missing input is reported before anything moves
            found = self._output.found()
            self._is_blind = found is None
            if found is None and not setup.assume_safe:
                raise UnknownVoltageError(
                    f"{self._description.name}: the voltage at the output is unknown, expected a card that reads it "
                    "back or a monitor; wire one (voltage_input), or make sure that the output is at its safe voltage "
                    "and set nidaqmx.assume_safe"
                )
            self._voltage = self._description.safe_voltage if found is None else found
            self._tasks.last_written = self._voltage
        except StageError:
            self._tasks.close()
            raise

    @property
    def description(self) -> Description:
        """Limits and scales from the setup; `latency` is that of the present sample period."""
        return self._description

    @property
    def sample_period(self) -> float:
        """Present sample period [s]."""
        return self._setup.sample_period

    @property
    def voltage(self) -> float:
        """Last commanded drive voltage [V]; after opening, the measured or assumed one."""
        return self._voltage

    def configure(self, sample_period: float) -> None:
        """Set the sample period [s]. A running stream ends at its last voltage."""
        self._require_open()
        period = self._description.check_sample_period(sample_period)
        if period != self.sample_period:
            with self._guarded():
                self._drain()
            self._setup = replace(self._setup, sample_period=period)
            self._description = self._setup.description()

    def restrict(self, limits: Description, ramp_rate: float) -> None:
        """Use these limits and this ramp rate [V/s] from now on; see `Limiter.restricted`."""
        self._require_open()
        self._limiter = Limiter(self._description).restricted(limits, ramp_rate)

    def exchange(self, voltage: Samples) -> Acquired:
        """Give a block of drive voltages [V]; returns as many samples, applied and measured `latency` earlier."""
        self._require_open()
        drive = self._limiter.check(voltage, self._voltage, self.sample_period)
        with self._guarded():
            return self._stream(drive)

    def set_voltage(self, voltage: float) -> None:
        """Go to one voltage [V] at the ramp rate and hold it; ends a stream."""
        self._require_open()
        goal = self._limiter.goal(voltage)
        with self._guarded():
            self._drain()
            self._output.require(self._voltage)
            self._go(goal)

    def read_displacement(self) -> float:
        """One reading of the sensor [m]; ends a stream."""
        self._require_open()
        with self._guarded():
            self._drain()
            return float(self._tasks.read_once()[0]) * self._setup.sensor_gain

    def read_voltage(self) -> float:
        """One reading of the drive voltage at the monitor [V], or without a monitor the last command; ends a stream."""
        self._require_open()
        with self._guarded():
            self._drain()
            readings = self._tasks.read_once()
            return float(self._output.measured(readings)) if self._setup.voltage_input else self._voltage

    def safe(self) -> None:
        """Play the samples in the buffer to their end, go to the safe voltage, and end the stream."""
        if self._closed:
            return
        try:
            self._retreat()
        except DaqmxError as error:
            raise StageError(f"{error}; {self._unknown()}") from None

    def close(self) -> None:
        """Go to the safe voltage and release the card; every later call but `close` and `safe` raises StageError."""
        try:
            self.safe()
        finally:
            self.leave()

    def leave(self) -> None:
        """Release the device without moving it; every later call but `close` and `safe` raises StageError."""
        if not self._closed:
            self._closed = True
            self._tasks.close()

    def _stream(self, drive: Samples) -> Acquired:
        if not self._tasks.is_running:
            self._output.require(self._voltage)
            self._waiting = np.full(self._setup.latency_samples, self._voltage)
            self._tasks.start(self.sample_period, np.full(self._setup.lead_samples, self._voltage))
            self._agreement, self._readings = self._new_agreement(), np.empty(0)
        self._tasks.write(drive)
        self._voltage = float(drive[-1])
        self._waiting = np.concatenate((self._waiting, drive))
        applied, self._waiting = self._waiting[: drive.size], self._waiting[drive.size :]
        readings, before = self._tasks.read(drive.size), self._readings
        if np.array_equal(readings, before) and np.ptp(readings[0]) > 0:
            raise DaqmxError(f"{self._description.name}: got the same {drive.size} samples twice; samples were lost")
        self._readings = readings
        measured = self._output.measured(readings) if self._setup.voltage_input else applied
        displacement = readings[0] * self._setup.sensor_gain
        self._agreement.check(applied, measured, displacement)
        return Acquired(measured, displacement)

    def _new_agreement(self) -> Agreement:
        s, d = self._setup, self._description
        settling = int(np.ceil(s.settling_time / self.sample_period))
        inside = _CLIPPED * d.displacement_max
        return Agreement(s.voltage_tolerance / abs(s.amplifier_gain), settling, -inside, inside)

    def _drain(self) -> None:
        """End the stream after its last voltage was put out."""
        if self._tasks.is_running:
            self._stream(np.full(self._setup.lead_samples, self._voltage))
            self._tasks.stop()

    def _guarded(self) -> AbstractContextManager[None]:
        return guarded(
            self._abort, lambda: f"the output was brought to its safe voltage, {self._voltage:g} V", self._unknown
        )

    def _retreat(self) -> None:
        if self._is_lost:
            self._abort()
        elif self._tasks.is_running:
            try:
                goal = self._description.safe_voltage
                for part in self._limiter.ramp(self._voltage, goal, self.sample_period, self._setup.lead_samples):
                    self._stream(part)
                self._drain()
            except DeviceError:
                self._abort()
        else:
            with suppress(DaqmxError):  # of a link that is lost: the output stands where it was left
                self._voltage = self._output.now(self._voltage)
            if self._voltage != self._description.safe_voltage:
                self._go(self._description.safe_voltage)

    def _abort(self) -> None:
        """End a stream that has failed, and go to the safe voltage from where the output stands, if that is certain."""
        self._tasks.abandon(runs_dry=self._is_blind)
        self._voltage = self._output.here()
        self._go(self._description.safe_voltage)

    def _go(self, goal: float) -> None:
        """Go to a voltage [V] by the ramp of the limiter, on the clock of the card; no stream is running."""
        period = max(min(self.sample_period, _RAMP_PERIOD), self._description.sample_period_min)
        for part in self._limiter.ramp(self._voltage, goal, period):
            if part.size > 1:
                self._tasks.play(part, period)
            else:
                self._tasks.write_once(goal)
            self._voltage = float(part[-1])
        self._is_lost = False

    def _unknown(self) -> str:
        self._is_lost = True
        return (
            f"the voltage of the stage is unknown, last commanded {self._voltage:g} V; switch the amplifier off "
            "by hand: the card holds its output"
        )

    def _require_open(self) -> None:
        if self._closed:
            raise StageError(f"{self._description.name}: is closed, expected an open stage; make a new one")
        if self._is_lost:
            raise StageError(f"{self._description.name}: {self._unknown()}")
