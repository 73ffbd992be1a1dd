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

"""`TimeBase`: converts between sample index, steady clock and time stamp. No ROS."""

from __future__ import annotations

import time
from collections.abc import Callable

_NANO = 1_000_000_000
"""Nanoseconds in a second."""
LATEST_STAMP = (2**31 - 3600) * _NANO
"""Latest stamp [ns]. A ROS message holds dates before 2038-01-19, 03:14:08 UTC (seconds in 32 bits); the last hour is
left for the times within a block."""
_TOGETHER = 2e-5
"""Two readings within this time count as simultaneous [s]."""
_ATTEMPTS = 8
"""Number of readings of both clocks; the closest pair is used."""


def read_together(node_clock: Callable[[], int]) -> tuple[float, int]:
    """Simultaneous readings of the steady clock [s] and of the node's clock [ns].

    A busy computer may interrupt the program between the two readings, which would look like a jump of the node's
    clock. Therefore the clocks are read several times, and the two readings with the shortest time between are used.
    """
    apart, steady, node = float("inf"), 0.0, 0
    for _ in range(_ATTEMPTS):
        before, reading, after = time.monotonic(), node_clock(), time.monotonic()
        if after - before < apart:
            apart, steady, node = after - before, (before + after) / 2, reading
        if apart < _TOGETHER:
            break
    return steady, node


class TimeBase:
    """The sample clock of a driver: it gives the time of every sample on the steady clock and on the node's clock.

    Parameters
    ----------
    sample_period : float
        Time between samples [s].
    rate : float
        Simulated seconds per second of the steady clock; 1 for every real stage.

    Notes
    -----
    A stamp is anchor + (index − anchor index)·T_s, with the sample period T_s, so that delays of the computer do not
    influence it. A jump of the node's clock is detected by comparing the two clocks.
    """

    tolerance = 1e-3
    """If the difference between the node's clock and the stamps exceeds this time [s], the anchor is renewed."""

    def __init__(self, sample_period: float, rate: float = 1.0) -> None:
        self.sample_period = sample_period
        self._real_period = sample_period / rate
        self.anchor(0, 0.0, 0)

    def anchor(self, index: int, steady: float, node: int) -> None:
        """Set the anchor: sample `index` is taken at `steady` [s] and `node` [ns] of the two clocks."""
        self._anchor(index, steady, node)
        self._offset = node - round(steady * _NANO)

    def due(self, index: int) -> float:
        """Time at which a sample is due on the steady clock [s]."""
        return self._steady + (index - self._index) * self._real_period

    def index_at(self, steady: float) -> int:
        """Index of the first sample that is not before `steady` [s]."""
        return self._index + -int((self._steady - steady) // self._real_period)

    def stamp(self, index: int) -> int:
        """Stamp of a sample [ns]; at least 0, also shortly after the start of a simulated clock.

        It stands still at `LATEST_STAMP`; the index continues to count the samples.
        """
        return min(max(0, self._stamp_at(index)), LATEST_STAMP)

    def follow(self, index: int, steady: float, node: int) -> float:
        """Renew the anchor at `index` if the node's clock has jumped against the steady clock.

        Returns
        -------
        float
            Shift of the stamps [s]; 0 if the clock has not jumped.
        """
        jump = node - round(steady * _NANO) - self._offset
        if abs(jump) <= self.tolerance * _NANO:
            return 0.0
        self._anchor(index, self.due(index), self._stamp_at(index) + jump)
        self._offset += jump
        return jump / _NANO

    def postpone(self, index: int, steady: float) -> float:
        """Shift the time base to later or earlier times, so that sample `index` is due at `steady` [s].

        In real time the stamps are shifted as well. For a simulated stage at another rate they are not.

        Returns
        -------
        float
            The shift [s].
        """
        delay = steady - self.due(index)
        moved = round(delay * _NANO) if self._real_period == self.sample_period else 0
        self._anchor(index, steady, self._stamp_at(index) + moved)
        return delay

    def _stamp_at(self, index: int) -> int:
        return self._stamp + round((index - self._index) * self.sample_period * _NANO)

    def _anchor(self, index: int, steady: float, stamp: int) -> None:
        self._index, self._steady, self._stamp = index, steady, stamp
