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

"""`Playback`: determines the voltage of every sample: hold, ramp or waveform. No ROS."""

from __future__ import annotations

import copy
import math

import numpy as np

from ..errors import StageError
from .drive import Drive, Event, EventKind, Phase, Samples

_ENDLESS = 1 << 62
"""Number of samples of an unlimited hold."""


class Playback:
    """Knows the present voltage and phase, and computes the samples that follow.

    Parameters
    ----------
    voltage : float
        Present voltage [V].
    safe_voltage : float
        Voltage that is approached after `stop` and after the hold time-out [V].
    sample_period : float
        Time between samples [s].
    ramp_rate : float
        Rate of every ramp [V/s].
    hold_timeout : float
        Time for which a voltage is held before the ramp to the safe voltage [s]; 0 holds it without limit.

    Notes
    -----
    Phase 0 is ``idle``. A waveform begins the next phase. The samples after a waveform (held voltage, set-points, the
    ramp to the safe voltage) form a phase ``hold``. `CommandCheck` checks the waveforms before they are played.
    """

    def __init__(
        self, voltage: float, safe_voltage: float, sample_period: float, ramp_rate: float, hold_timeout: float = 0.0
    ) -> None:
        self.voltage = float(voltage)
        self.phase = Phase(0, "idle")
        self._safe_voltage = float(safe_voltage)
        self._step = ramp_rate * sample_period
        self._hold_limit = math.ceil(hold_timeout / sample_period) if hold_timeout > 0 else _ENDLESS
        self._held = 0
        self._waveform: Samples | None = None
        self._played = 0
        self._target = self.voltage
        self._stopping = False
        self._events: list[tuple[EventKind, Phase]] = [(EventKind.BEGAN, self.phase)]

    @property
    def is_playing(self) -> bool:
        """True while a waveform is played."""
        return self._waveform is not None

    @property
    def is_stopping(self) -> bool:
        """True on the ramp to the safe voltage after `stop`."""
        return self._stopping

    @property
    def is_safe(self) -> bool:
        """True at rest at the safe voltage."""
        return not self.is_playing and self.voltage == self._target == self._safe_voltage

    @property
    def pending(self) -> int:
        """Number of samples until the present waveform or ramp ends; 0 while a voltage is held."""
        if self._waveform is not None:
            return self._waveform.size - self._played
        return math.ceil(abs(self._target - self.voltage) / self._step - 1e-9)

    def play(self, waveform: Samples, name: str, stamp: int = 0) -> Phase:
        """Begin the next phase with a waveform [V], at the next sample.

        Raises
        ------
        StageError
            If another waveform is being played, or the stage is on its way to the safe voltage.
        """
        self.require_free(name)
        self._waveform, self._played = waveform, 0
        return self._begin(name, True, stamp)

    def ramp_to(self, voltage: float) -> None:
        """Go to a voltage [V] at the ramp rate and hold it; raises StageError as `play` does."""
        self.require_free("set_voltage")
        self._hold()
        self._target = float(voltage)

    def stop(self) -> Phase:
        """End the present phase, go to the safe voltage, and return the ended phase; may be repeated."""
        stopped = self.phase
        if self.is_playing:
            self._waveform = None
            self._events.append((EventKind.STOPPED, stopped))
        self._hold()
        self._target, self._stopping = self._safe_voltage, True
        return stopped

    def jump(self, voltage: float) -> None:
        """Hold the voltage [V] to which a device went by itself."""
        if self.is_playing:
            self._events.append((EventKind.STOPPED, self.phase))
        self._waveform, self._stopping = None, False
        self.voltage = self._target = float(voltage)
        self._hold()

    def pass_unseen(self, count: int) -> None:
        """Skip `count` samples of a held voltage that are not measured; they count for the hold time-out only."""
        self._held = min(self._held + count, self._hold_limit - 1)

    def preview(self, count: int) -> Drive:
        """The next `count` samples, without taking them; for a device that receives its samples in advance."""
        twin = copy.copy(self)
        twin._events = list(self._events)
        return twin.take(count)

    def take(self, count: int) -> Drive:
        """Take the next `count` samples, which then count as applied."""
        voltage, phase = np.empty(count), np.empty(count, np.uint32)
        events: list[Event] = []
        at = 0
        while at < count:
            events += [Event(at, *event) for event in self._events]
            self._events.clear()
            number = self.phase.number
            part = self._advance(count - at)
            voltage[at : at + part.size] = part
            phase[at : at + part.size] = number
            at += part.size
        events += [Event(count, *event) for event in self._events if event[0] is not EventKind.BEGAN]
        self._events = [event for event in self._events if event[0] is EventKind.BEGAN]
        return Drive(voltage, phase, tuple(events))

    def _advance(self, count: int) -> Samples:
        """Return one to `count` samples of the present waveform, ramp or hold, and advance the state."""
        if self._waveform is not None:
            part = self._waveform[self._played : self._played + count]
            self._played += part.size
            self.voltage = float(part[-1])
            if self._played == self._waveform.size:
                self._waveform = None
                self._events.append((EventKind.DONE, self.phase))
                self._hold()
            return part
        if self.pending:
            steps = np.arange(1, min(count, self.pending) + 1)
            ramp = self.voltage + math.copysign(self._step, self._target - self.voltage) * steps
            part = np.clip(ramp, min(self.voltage, self._target), max(self.voltage, self._target))
            self.voltage, self._held = float(part[-1]), 0
            if not self.pending:
                self.voltage = part[-1] = self._target
                self._stopping = False
            return part
        self.voltage, self._stopping = self._target, False
        part = np.full(min(count, self._hold_limit - self._held), self.voltage)
        self._held += part.size
        if self._held == self._hold_limit:
            self._held, self._target = 0, self._safe_voltage
        return part

    def _hold(self) -> None:
        self._target, self._held = self.voltage, 0
        if self.phase.commanded or self.phase.number == 0:
            self._begin("hold")

    def _begin(self, name: str, commanded: bool = False, stamp: int = 0) -> Phase:
        self.phase = Phase((self.phase.number + 1) % (1 << 32), name, commanded, stamp)
        self._events.append((EventKind.BEGAN, self.phase))
        return self.phase

    def require_free(self, name: str) -> None:
        """Raise StageError while a waveform is played, or on the way to the safe voltage."""
        if self.is_playing:
            raise StageError(f"{name}: '{self.phase.name}' is being played; wait for its end or stop it")
        if self._stopping:
            raise StageError(f"{name}: the stage is on its way to the safe voltage; wait until it is there")
