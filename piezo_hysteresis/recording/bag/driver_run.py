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

"""`Run`: the samples of a bag since one start of the driver."""

from __future__ import annotations

from dataclasses import dataclass, field

LONGEST_SILENCE = 60.0
"""An index that runs ahead of the clock by more than this shows a restart of the driver, not a gap [s]."""

LATENESS = 0.1
"""Largest difference between the stamp of a late or repeated block and the time of its index [s]. If it is larger, the
clock was set back and the driver was started again."""


@dataclass
class Run:
    """Samples since one start of the driver, or since a change of its sample period.

    Parameters
    ----------
    first : bool
        True for the first run since a start of the driver.
    period : float
        Sample period [s].
    expected : int
        Index after the newest sample, not wrapped.
    begin : int
        Index at which the run begins.
    newest : int
        Arrival of the newest sample.
    pieces : list of (int, int, int)
        Index and arrival (start, stop) of every uninterrupted piece.
    """

    first: bool
    period: float
    expected: int
    begin: int
    newest: int = 0
    pieces: list[tuple[int, int, int]] = field(default_factory=list)

    def add(self, index: int, start: int, stop: int) -> None:
        """Add a piece."""
        self.pieces.append((index, start, stop))
        if index + stop - start > self.expected:
            self.expected, self.newest = index + stop - start, stop - 1

    def ends_before(self, step: int, period: float, elapsed: float) -> bool:
        """Whether the driver was started again before a sample.

        Parameters
        ----------
        step : int
            Its index minus the expected one.
        period : float
            Its sample period [s].
        elapsed : float
            Its time since the newest sample [s].
        """
        if step < 0:
            return elapsed > 0 or abs(elapsed - step * period) > LATENESS
        return step * period > 10 * max(elapsed, 0.0) + LONGEST_SILENCE
