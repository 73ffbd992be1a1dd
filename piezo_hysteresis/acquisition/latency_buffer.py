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

"""`LatencyBuffer`: delays the labels of a drive by the latency of the stage. No ROS."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .drive import Drive, Event


class LatencyBuffer:
    """Delays phases and events by the latency of a streaming stage.

    Parameters
    ----------
    latency : int
        Number of samples between a voltage and the measurement of its effect.
    phase : int
        Number of the phase of the samples that are returned first.
    """

    def __init__(self, latency: int, phase: int) -> None:
        self._latency = latency
        self._phase = np.full(latency, phase, dtype=np.uint32)
        self._events: list[Event] = []
        self._rested = 0

    def has_settled(self, at_rest: bool, count: int) -> bool:
        """Whether the labels of all samples before the rest of the drive have been returned.

        Parameters
        ----------
        at_rest : bool
            Whether the drive was at rest for the whole of the last block.
        count : int
            Number of samples of that block.
        """
        self._rested = self._rested + count if at_rest else 0
        return self._rested >= self._latency and not self._events

    def follow(self, drive: Drive) -> Drive:
        """Take the drive that is applied now, and return the labels of the samples that are measured now.

        Parameters
        ----------
        drive : Drive

        Returns
        -------
        Drive
            Drive with the same number of samples and the same voltage; phases and events are delayed.
        """
        if not self._latency:
            return drive
        count = drive.phase.size
        phases = np.concatenate((self._phase, drive.phase))
        self._phase = phases[count:]
        events = [*self._events, *(replace(e, offset=e.offset + self._latency) for e in drive.events)]
        self._events = [replace(e, offset=e.offset - count) for e in events if e.offset >= count]
        return replace(drive, phase=phases[:count], events=tuple(e for e in events if e.offset < count))
