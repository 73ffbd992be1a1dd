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

"""`TimeBase`: sample index <-> steady clock <-> stamp. No ROS."""

from __future__ import annotations

import time
from collections.abc import Callable

_NANO = 1_000_000_000
"""Nanoseconds in a second."""
_TOGETHER = 2e-5
"""Two readings so close count as one moment [s]."""
_ATTEMPTS = 8
"""Readings of both clocks, of which the closest pair counts."""


def read_together(node_clock: Callable[[], int]) -> tuple[float, int]:
    """The steady clock [s] and the node's [ns] at one moment.

    A busy computer may take the processor away between the two readings, which then would look like a jump of the
    node's clock: of several attempts the closest counts.
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
    """The sample clock of a driver, counted on the steady clock and stamped on the node's clock.

    Parameters
    ----------
    sample_period : float
        Time between samples [s].
    rate : float
        Seconds of the stage per second of the steady clock; 1 for every real stage.

    Notes
    -----
    A stamp is anchor + (index − anchor index)·T_s, free of the jitter of the computer. Only the two clocks are compared
    to find a jump of the node's clock; a block that is published late moves nothing.
    """

    tolerance = 1e-3
    """Departure of the node's clock from the stamps at which they are anchored anew [s]."""

    def __init__(self, sample_period: float, rate: float = 1.0) -> None:
        self.sample_period = sample_period
        self._real_period = sample_period / rate
        self.anchor(0, 0.0, 0)

    def anchor(self, index: int, steady: float, node: int) -> None:
        """Let sample `index` be taken at `steady` [s] on the steady clock, `node` [ns] on the node's."""
        self._anchor(index, steady, node)
        self._offset = node - round(steady * _NANO)

    def due(self, index: int) -> float:
        """Time of a sample on the steady clock [s]."""
        return self._steady + (index - self._index) * self._real_period

    def index_at(self, steady: float) -> int:
        """First sample that is not before `steady` [s]."""
        return self._index + -int((self._steady - steady) // self._real_period)

    def stamp(self, index: int) -> int:
        """Stamp of a sample [ns]; not below zero, where a simulated clock has just begun."""
        return max(0, self._stamp_at(index))

    def follow(self, index: int, steady: float, node: int) -> float:
        """Anchor anew at `index` if the node's clock, read together with the steady one, has jumped.

        Returns
        -------
        float
            By how much the stamps moved [s]; 0 where nothing had to be done.
        """
        jump = node - round(steady * _NANO) - self._offset
        if abs(jump) <= self.tolerance * _NANO:
            return 0.0
        self._anchor(index, self.due(index), self._stamp_at(index) + jump)
        self._offset += jump
        return jump / _NANO

    def postpone(self, index: int, steady: float) -> float:
        """Let sample `index` be due at `steady` [s], later than it was, or earlier where a device's clock is faster.

        Stamps move along in real time; where the stage runs at another rate they stay without a gap.

        Returns
        -------
        float
            The delay [s].
        """
        delay = steady - self.due(index)
        moved = round(delay * _NANO) if self._real_period == self.sample_period else 0
        self._anchor(index, steady, self._stamp_at(index) + moved)
        return delay

    def _stamp_at(self, index: int) -> int:
        return self._stamp + round((index - self._index) * self.sample_period * _NANO)

    def _anchor(self, index: int, steady: float, stamp: int) -> None:
        self._index, self._steady, self._stamp = index, steady, stamp
