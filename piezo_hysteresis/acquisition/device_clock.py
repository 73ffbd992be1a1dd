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

"""`DeviceClock`: adjusts the time base to the clock of a device that has its own sample clock. No ROS."""

from __future__ import annotations

import math
import time

from .sample_block import Tally
from .time_base import TimeBase

_WINDOW = 100
"""Number of blocks; the one with the smallest delay is used to compare the clocks."""


class DeviceClock:
    """Estimates the clock of a device from the arrival times of its blocks.

    The difference of two quartz clocks changes by up to about 50 µs per second. A block arrives with a varying delay
    after its last sample. The smallest delay among many blocks gives the difference of the clocks.

    Parameters
    ----------
    time_base : TimeBase
        The time base to adjust; it is shifted when the clocks differ by more than its tolerance.
    """

    def __init__(self, time_base: TimeBase) -> None:
        self._time_base = time_base
        self._least, self._blocks = math.inf, 0

    def follow(self, end: int, now: float) -> float:
        """Record that the block before sample `end` arrived at `now` [s] on the steady clock.

        Returns
        -------
        float
            Shift of the time base to later times [s]; 0 if no shift was needed.
        """
        late = now - self._time_base.due(end)
        self._least, self._blocks = min(self._least, late), self._blocks + 1
        if late >= -self._time_base.tolerance and self._blocks < _WINDOW:
            return 0.0
        difference = self._least
        self._least, self._blocks = math.inf, 0
        if abs(difference) <= self._time_base.tolerance:
            return 0.0
        return self._time_base.postpone(end, self._time_base.due(end) + difference)

    def follow_block(self, first: int, count: int, tally: Tally) -> None:
        """Follow the device after it has returned `count` samples that begin at index `first`; they are counted."""
        end, now = first + count, time.monotonic()
        if first == 0:  # the time for opening the stream is unknown
            self._time_base.postpone(end, now)
        tally.latest = max(tally.latest, now - self._time_base.due(end))
        tally.clock_drift += self.follow(end, now)
