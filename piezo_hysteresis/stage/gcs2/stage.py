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

"""`Gcs2Stage`: an axis of a PI GCS 2.0 controller in open loop, as a stage with on-board memory."""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import AbstractContextManager
from typing import cast

import numpy as np

from ...errors import DeviceError, StageError
from ..agreement import Agreement
from ..guard import guarded
from ..limiter import Limiter
from ..stage import Acquired, Description, Samples
from .axis import Axis
from .setup import Gcs2Setup

_POLL = 5e-3
"""Shortest time between two queries whether the generator is running [s]."""


class Gcs2Stage:
    """One axis, driven by voltage from the wave table and recorded by the data recorder at the servo rate.

    Opening queries identity, servo time and limits, and moves nothing. Before every open-loop move the servo is
    switched off, and that is verified. If the device fails, the stage goes to its safe voltage, over a new link if
    necessary; the error message says whether it got there.

    Parameters
    ----------
    setup : Gcs2Setup

    Raises
    ------
    StageError
        If the controller cannot be reached or contradicts the setup.
    """

    def __init__(self, setup: Gcs2Setup) -> None:
        self._setup, self._axis = setup, Axis(setup)
        self._closed, self._armed, self._playing, self._played, self._due = False, False, False, False, 0.0
        self._waveform: Samples | None = None
        self._acquired: Acquired | None = None
        try:
            self._description = self._axis.identify()
            self._voltage = self._axis.voltage()
        except StageError:
            self._axis.client.connection.close()
            raise
        self._limiter = Limiter(self._description)
        self._sample_period = self._axis.servo_time

    @property
    def description(self) -> Description:
        """Identity and limits as the controller reported them."""
        return self._description

    @property
    def sample_period(self) -> float:
        """Present sample period [s], a multiple of the servo time."""
        return self._sample_period

    @property
    def voltage(self) -> float:
        """Present drive voltage [V]: measured on opening, later the commanded one."""
        return self._voltage

    def configure(self, sample_period: float) -> None:
        """Set the sample period [s]; a waveform in memory is discarded."""
        self._require_ready()
        period = self._description.check_sample_period(sample_period)
        self._sample_period = round(period / self._axis.servo_time) * self._axis.servo_time
        self._waveform = None
        self._forget()

    def restrict(self, limits: Description, ramp_rate: float) -> None:
        """Use these limits and this ramp rate [V/s] from now on; tests whether the controller can draw ramps."""
        self._require_ready()
        self._limiter = Limiter(self._description).restricted(limits, ramp_rate)
        self._waveform = None
        with self._guarded():
            self._voltage = self._axis.take_over(self._voltage)

    def watch(self, is_interrupted: Callable[[], bool]) -> None:
        """Call `is_interrupted` before every message of upload, arm, start and read; StoppedError once it is true.

        Between two calls there is one command, or one answer of `rows_per_answer` samples.
        """
        self._axis.waves.is_interrupted = is_interrupted

    def set_voltage(self, voltage: float) -> None:
        """Go to one voltage [V] at the ramp rate, hold and verify it; a waveform in memory is discarded."""
        self._require_ready()
        goal = self._limiter.goal(voltage)
        with self._guarded():
            self._axis.open_loop(self._voltage)
            self._go(goal)

    def read_voltage(self) -> float:
        """One reading of the drive voltage at the piezo [V]."""
        self._require_ready()
        with self._guarded():
            return self._axis.voltage()

    def read_displacement(self) -> float:
        """One reading of the sensor [m]."""
        self._require_ready()
        with self._guarded():
            return self._axis.displacement()

    def upload(self, voltage: Samples) -> None:
        """Store a waveform [V] in the wave table."""
        self._require_ready()
        waveform = self._limiter.check(voltage, self._voltage, self._sample_period).copy()
        self._waveform = None
        self._forget()
        with self._guarded():
            self._axis.waves.load(waveform)
        self._waveform = waveform

    def arm(self) -> None:
        """Set generator and recorder; the servo is off afterwards."""
        self._require_ready()
        if self._waveform is None:
            raise StageError(f"{self._description.name}: holds no waveform, expected upload() first")
        self._limiter.check(self._waveform, self._voltage, self._sample_period)
        with self._guarded():
            self._axis.open_loop(self._voltage)
            self._axis.arm(round(self._sample_period / self._axis.servo_time))
        self._forget()
        self._armed = True

    def start(self) -> None:
        """Play and record the waveform."""
        self._require_ready()
        if not self._armed or self._waveform is None:
            raise StageError(f"{self._description.name}: started without being armed, expected arm() first")
        self._armed = False
        with self._guarded():
            self._axis.require_servo_off("before the start")
            self._axis.start()
        self._playing = True
        self._due = time.monotonic() + self._waveform.size * self._sample_period
        self._voltage = float(self._waveform[-1])

    def wait(self, timeout: float) -> None:
        """Return when the waveform has been played; StageError after `timeout` [s]."""
        self._require_open()
        if not self._playing:
            if not self._played:
                raise StageError(f"{self._description.name}: nothing to wait for, expected start() first")
            return
        end = time.monotonic() + max(timeout, 0.0)
        with self._guarded():
            while self._axis.is_playing():
                now = time.monotonic()
                if now >= end:
                    break
                time.sleep(min(end - now, max(self._due - now, _POLL)))
            else:
                self._playing, self._played = False, True
                return
        raise StageError(f"{self._description.name}: still playing after {timeout:g} s; wait again")

    def read(self) -> Acquired:
        """The record of the waveform that was played."""
        self._require_ready()
        if not self._played:
            raise StageError(f"{self._description.name}: nothing recorded, expected upload, arm, start, wait first")
        if self._acquired is None:
            with self._guarded():
                self._acquired = self._record()
        return self._acquired

    def safe(self) -> None:
        """Stop a waveform that is playing, and ramp to the safe voltage, over a new link if the old one is lost."""
        if self._closed:
            return
        try:
            self._retreat()
        except DeviceError as error:
            raise StageError(f"{error}; {self._unknown()}") from None

    def close(self) -> None:
        """Go to the safe voltage and close the link; every later call but `close` and `safe` raises StageError."""
        try:
            self.safe()
        finally:
            self.leave()

    def leave(self) -> None:
        """Release the device without moving it; every later call but `close` and `safe` raises StageError."""
        self._closed = True
        self._axis.client.connection.close()

    def _forget(self) -> None:
        self._armed, self._playing, self._played, self._acquired = False, False, False, None

    def _record(self) -> Acquired:
        waveform = cast(Samples, self._waveform)
        voltage, displacement = self._axis.record(waveform.size, self._sample_period)
        self._axis.require_servo_off("after the run")
        tolerance = self._setup.voltage_tolerance / abs(self._setup.amplifier_gain)
        settling = int(np.ceil(self._setup.settling_time / self._sample_period))
        Agreement(tolerance, settling).check(waveform, voltage, displacement)
        self._axis.require_voltage(self._voltage)
        return Acquired(voltage, displacement)

    def _guarded(self) -> AbstractContextManager[None]:
        return guarded(
            self._retreat,
            lambda: f"the stage was brought to its safe voltage, {self._voltage:g} V",
            self._unknown,
        )

    def _retreat(self) -> None:
        self._forget()
        with self._axis.waves.uninterrupted():
            self._axis.stop()
            self._axis.open_loop()
            self._voltage = self._axis.voltage()
            self._go(self._description.safe_voltage)

    def _go(self, goal: float) -> None:
        """Ramp to a voltage [V] with the samples of the limiter, on the servo clock; the servo is off."""
        self._waveform = None
        longest = cast(int, self._description.longest_block)
        for part in self._limiter.ramp(self._voltage, goal, self._axis.servo_time, longest):
            if part.size > 1:
                self._axis.follow(part)
            else:
                self._axis.set_voltage(float(part[-1]))
            self._voltage = float(part[-1])
        self._axis.require_voltage(goal)

    def _unknown(self) -> str:
        return (
            f"the voltage of the stage is unknown, last commanded {self._voltage:g} V; switch the amplifier off by hand"
        )

    def _require_ready(self) -> None:
        self._require_open()
        if self._playing:
            raise StageError(f"{self._description.name}: is still playing, expected wait() first")

    def _require_open(self) -> None:
        if self._closed:
            raise StageError(f"{self._description.name}: is closed, expected an open stage; make a new one")
