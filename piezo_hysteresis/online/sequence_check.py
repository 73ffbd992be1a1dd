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

"""`SequenceCheck`: checks the running index of a stream of blocks for lost samples, repeated samples and restarts."""

from __future__ import annotations

from dataclasses import dataclass

from ..errors import RecordError

LONGEST_SILENCE = 60.0
"""Limit for a jump of the index [s]. From the time of the missing samples, ten times the time between the stamps is
subtracted. Above this limit the jump counts as a restart, below it as lost samples."""

SHORTEST_PERIOD, LONGEST_PERIOD = 1e-7, 1e3
"""Limits of the sample period of a stream [s]."""

LONGEST_DELAY = 1.0
"""Limit for an index that goes back [s]. A block that goes back further, or whose stamp is newer than the end of the
block before, counts as a restart; any other as late or repeated."""


@dataclass(frozen=True, slots=True)
class Arrival:
    """Relation of a block to the blocks before it.

    Parameters
    ----------
    missing : int
        Number of samples missing before the block.
    repeated : int
        Number of leading samples that had been received already; all samples where the block is late or repeated.
    restarted : bool
        True for the first block of a stream, and for the first block after a restart of the driver.
    """

    missing: int = 0
    repeated: int = 0
    restarted: bool = False


class SequenceCheck:
    """Follows the index, which wraps at 2³², and counts lost, repeated and late samples.

    Parameters
    ----------
    sample_period : float
        Time between samples [s].

    Attributes
    ----------
    received, lost, repeated, restarts : int
        Numbers of accepted samples, of lost samples, of samples that came twice or too late, and of restarts.

    Raises
    ------
    RecordError
        If the sample period is outside the limits.
    """

    def __init__(self, sample_period: float) -> None:
        if not SHORTEST_PERIOD <= sample_period <= LONGEST_PERIOD:
            raise RecordError(
                f"sample period: got {sample_period:g} s, expected {SHORTEST_PERIOD:g} to {LONGEST_PERIOD:g} s"
            )
        self.sample_period = sample_period
        self.received = self.lost = self.repeated = self.restarts = 0
        self._expected: int | None = None
        self._end = 0

    def join(self, index: int, stamp: int, size: int, follows_gap: bool = False) -> Arrival:
        """Compare the next block with the blocks before it.

        Parameters
        ----------
        index : int
            Index of its first sample.
        stamp : int
            Time of its first sample [ns].
        size : int
            Number of samples.
        follows_gap : bool
            True if the samples missing before it were never measured; they are not counted as lost.

        Returns
        -------
        Arrival
        """
        if self._expected is None:
            arrival = Arrival(restarted=True)
        else:
            arrival = self._compare(_signed(index - self._expected), (stamp - self._end) * 1e-9, size)
        self.repeated += arrival.repeated
        if arrival.repeated == size:
            return arrival
        self.restarts += arrival.restarted and self._expected is not None
        self.lost += 0 if follows_gap else arrival.missing
        self.received += size - arrival.repeated
        self._expected = (index + size) % 2**32
        self._end = stamp + round(size * self.sample_period * 1e9)
        return arrival

    def _compare(self, step: int, elapsed: float, size: int) -> Arrival:
        if step == 0:
            return Arrival()
        if step > 0:
            unexplained = step * self.sample_period - 10 * max(elapsed, 0.0)
            return Arrival(restarted=True) if unexplained > LONGEST_SILENCE else Arrival(missing=step)
        if elapsed > 0 or -step * self.sample_period > LONGEST_DELAY:
            return Arrival(restarted=True)
        return Arrival(repeated=min(-step, size))


def _signed(step: int) -> int:
    """The difference closest to zero that equals `step` modulo 2³²."""
    return (step + 2**31) % 2**32 - 2**31
