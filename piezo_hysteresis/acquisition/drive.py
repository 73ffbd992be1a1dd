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

"""`Drive`: the next samples to apply, and the phases that begin or end among them; `OpenCommands`. No ROS."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import NDArray

Samples = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Phase:
    """A numbered section of the stream: the label of its samples.

    Parameters
    ----------
    number : int
        Running number, from 0 when the driver becomes active.
    name : str
        Phase name.
    commanded : bool
        True if the phase is a commanded waveform.
    stamp : int
        Stamp of that command [ns]; 0 without a command.
    """

    number: int
    name: str
    commanded: bool = False
    stamp: int = 0

    def __str__(self) -> str:
        return f"{self.number} {self.name}"


class EventKind(Enum):
    """What can happen to a phase within a block."""

    BEGAN = "began"
    """The next sample is the first one of the phase."""
    DONE = "done"
    """The waveform of the phase was played to its end."""
    STOPPED = "stopped"
    """The waveform of the phase was ended before its last sample."""


@dataclass(frozen=True, slots=True)
class Event:
    """Before sample `offset` of a block, a phase began, was completed, or was stopped (by a fault: `reason`)."""

    offset: int
    kind: EventKind
    phase: Phase
    reason: str = ""


@dataclass(frozen=True, eq=False, slots=True)
class Drive:
    """The next samples to apply.

    Parameters
    ----------
    voltage : (n,) ndarray of float64
        Drive voltage [V].
    phase : (n,) ndarray of uint32
        Number of the phase of every sample.
    events : tuple of Event
        Events in the order of their offsets.
    """

    voltage: Samples
    phase: NDArray[np.uint32]
    events: tuple[Event, ...]


class OpenCommands:
    """The commands that were accepted, and whose end was not reported yet."""

    def __init__(self) -> None:
        self._phases: dict[int, Phase] = {}

    def add(self, phase: Phase) -> None:
        """A command was accepted."""
        self._phases[phase.number] = phase

    def follow(self, events: tuple[Event, ...]) -> None:
        """These events are reported now."""
        for event in events:
            if event.kind is not EventKind.BEGAN:
                self._phases.pop(event.phase.number, None)

    def stop(self, reason: str) -> tuple[Event, ...]:
        """The ends of all of them, because no sample follows any more; to be reported now."""
        phases, self._phases = self._phases, {}
        return tuple(Event(0, EventKind.STOPPED, phase, reason) for phase in phases.values())
