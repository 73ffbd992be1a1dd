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

"""`Motion`: a simulated stage whose simulation continues between commands, and which plays waveforms."""

from __future__ import annotations

import math
import time

import numpy as np

from ...stage.description import Samples
from ...stage.simulated import SimulatedStage
from ...stage.stage import Acquired
from ..fault import Faults
from .recorder import Recorder

_LONGEST_REST = 0.2
"""Longest time at rest that is simulated between two commands [s]."""


class Motion:
    """The stage behind an emulated controller, advanced in servo cycles.

    The simulated time is that of the computer times `speed`. Of a rest between two commands, at most 0.2 s are
    simulated; creep does not continue after this time.

    Parameters
    ----------
    stage : SimulatedStage
        Its sample period is the servo time.
    recorder : Recorder
        Receives every sample.
    faults : Faults
        Faults that occur.
    speed : float
        Simulated seconds per second of the computer; infinite to play every waveform at once.
    """

    def __init__(self, stage: SimulatedStage, recorder: Recorder, faults: Faults, speed: float) -> None:
        self.stage, self._recorder, self._faults, self._speed = stage, recorder, faults, speed
        self.servo_time = stage.sample_period
        if faults.lasts("wrong_servo_time"):
            stage.configure(2 * self.servo_time)
        self._waveform: Samples = np.empty(0)
        self._updated = time.monotonic()
        self.command = stage.voltage
        self._position = 0.0
        self.advance()

    @property
    def cycle(self) -> float:
        """Servo cycle that is really used [s]; the fault ``wrong_servo_time`` doubles it."""
        return self.stage.sample_period

    @property
    def is_playing(self) -> bool:
        """True while a waveform is being played."""
        return bool(self._waveform.size)

    @property
    def voltage(self) -> float:
        """Piezo voltage [V]."""
        return self.stage.read_voltage() * self.stage.description.amplifier_gain

    @property
    def position(self) -> float:
        """Position [m] as the sensor reports it now."""
        self._run(np.full(1, self.command))
        return self._position

    def advance(self) -> None:
        """Simulate the time since the last call."""
        now = time.monotonic()
        if math.isinf(self._speed):
            cycles = self._waveform.size
        else:
            cycles = int((now - self._updated) * self._speed / self.cycle)
            now = self._updated + cycles * self.cycle / self._speed
        self._updated = now
        played, self._waveform = self._waveform[:cycles], self._waveform[cycles:]
        if played.size:
            self._run(played)
        rest = min(cycles - played.size, int(_LONGEST_REST / self.cycle))
        if rest > 0:
            self._run(np.full(rest, self.command))

    def set(self, drive: float) -> None:
        """Apply a drive voltage [V] for one cycle; it is then held."""
        self._run(np.full(1, drive))

    def play(self, waveform: Samples) -> None:
        """Start to play drive voltages (n,) [V], one per servo cycle."""
        self._updated, self._waveform = time.monotonic(), waveform
        self.advance()

    def stop(self) -> None:
        """End the waveform and hold the present voltage."""
        self._waveform = np.empty(0)

    def _run(self, drive: Samples) -> None:
        self.command = float(drive[-1])
        d = self.stage.description
        if self._faults.lasts("saturated"):
            drive = np.minimum(drive, d.safe_voltage + 0.5 * (d.voltage_max - d.safe_voltage))
        got = self.stage.exchange(drive)
        if self._faults.lasts("stale"):
            got = Acquired(got.voltage, np.full(drive.size, self._position))
        self._position = float(got.displacement[-1])
        self._recorder.take(drive, got.voltage * d.amplifier_gain, got.displacement)
