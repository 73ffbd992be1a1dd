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

"""`RecordedPlayback`: labels samples with the phases of a replayed experiment instead of commanded phases. No ROS."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from ..errors import StageError
from .drive import Drive, Event, EventKind, Phase
from .playback import Playback


class RecordedPlayback:
    """Used instead of `Playback` for a stage that replays records and cannot be driven.

    Parameters
    ----------
    phases : iterable of tuple
        Name and number of samples of every phase, in the order in which the stage plays them.
    voltage : float
        Voltage before the first phase [V].
    repeat : bool
        Whether the phases are repeated after the last one; otherwise a phase ``hold`` follows.
    """

    is_playing = is_stopping = False
    is_safe = True

    def __init__(self, phases: Iterable[tuple[str, int]], voltage: float, repeat: bool = False) -> None:
        self._phases = tuple(phases)
        self._repeat = repeat
        self._next = 0
        self._left: float = 0
        self.phase = Phase(0, "idle")
        self.voltage = voltage

    def take(self, count: int) -> Drive:
        """Labels of the next `count` samples. The stage ignores the voltages."""
        phase = np.empty(count, np.uint32)
        events: list[Event] = []
        at = 0
        while at < count:
            if not self._left:
                self._open()
                events.append(Event(at, EventKind.BEGAN, self.phase))
            part = int(min(count - at, self._left))
            phase[at : at + part] = self.phase.number
            self._left -= part
            at += part
        return Drive(np.full(count, self.voltage), phase, tuple(events))

    def _open(self) -> None:
        if self._repeat:
            self._next %= len(self._phases)
        name, self._left = self._phases[self._next] if self._next < len(self._phases) else ("hold", float("inf"))
        self.phase = Phase(self.phase.number + 1, name)
        self._next += 1

    def require_free(self, name: str) -> None:
        """Raise StageError: a replayed stage accepts no command."""
        raise StageError(f"{name}: a recording is replayed and cannot be driven")

    def play(self, waveform: object, name: str, stamp: int = 0) -> Phase:
        """Raise StageError: a replayed stage accepts no command."""
        self.require_free(name)
        return self.phase

    def ramp_to(self, voltage: float) -> None:
        """Raise StageError: a replayed stage accepts no command."""
        self.require_free("set_voltage")

    def stop(self) -> Phase:
        """Do nothing: a replayed stage has no voltage to remove."""
        return self.phase


Source = Playback | RecordedPlayback
"""What gives an acquisition its samples."""
