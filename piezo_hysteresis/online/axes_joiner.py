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

"""`AxesJoiner`: joins the streams of several drivers to one stream of all axes, sample by sample."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, field

from ..acquisition.sample_block import SampleBlock
from ..errors import RecordError
from .sequence_check import LONGEST_DELAY, SequenceCheck

LARGEST_SKEW = 1e-3
"""Difference between stamp and index above which a stream is joined anew [s]; drivers correct their stamps likewise."""

LONGEST_WAIT = 2.0
"""Length of the samples of a stream that wait for the other streams [s]; older ones are dropped."""

PERIOD_TOLERANCE = 1e-3
"""Largest relative difference of the sample periods of a stream and of the model, as in the identification."""


@dataclass(frozen=True, eq=False, slots=True)
class JoinedBlock:
    """Samples of all streams that were taken at the same times.

    Parameters
    ----------
    blocks : tuple of SampleBlock
        One of each stream, all of one size; a block with one sample or more.
    missing : int
        Number of samples before it that did not arrive from every stream.
    restarted : bool
        True for the first block, and after the clock of the streams was set back.
    """

    blocks: tuple[SampleBlock, ...]
    missing: int
    restarted: bool

    @property
    def follows_gap(self) -> bool:
        """True where the missing samples were never measured."""
        return any(block.follows_gap for block in self.blocks)

    @property
    def is_undriven(self) -> bool:
        """True where no stage has been driven since its driver began."""
        return all(block.index[0] == 0 or block.phase[0] == 0 for block in self.blocks)


@dataclass(eq=False, slots=True)
class _Stream:
    """One stream: samples that wait for the others, each block with the number of its first sample."""

    check: SequenceCheck
    end: int = 0
    waiting: deque[tuple[int, SampleBlock]] = field(default_factory=deque)

    def drop_before(self, number: int) -> None:
        """Drop the samples before a number."""
        while self.waiting and self.waiting[0][0] < number:
            first, block = self.waiting.popleft()
            if first + block.size > number:
                self.waiting.appendleft((number, block.between(number - first, block.size)))


class AxesJoiner:
    """Numbers the samples of all streams by their time, and returns those that every stream has.

    Inside a stream the running index numbers the samples. The stamps relate the streams: at the beginning, after a
    restart, and where stamp and index come to differ by more than `LARGEST_SKEW` and one sample. Two streams are
    therefore joined as exactly as their stamps are, and to half a sample at best.

    Parameters
    ----------
    streams : int
        Number of streams.
    sample_period : float
        Time between samples, the same for all streams [s].

    Attributes
    ----------
    joined, rejoined : int
        Number of joined samples, and how often a stream was joined anew because its stamps had moved.

    Raises
    ------
    RecordError
        If the sample period is outside the limits of a stream.
    """

    def __init__(self, streams: int, sample_period: float) -> None:
        self.sample_period = sample_period
        self.joined = self.rejoined = 0
        self._streams = [_Stream(SequenceCheck(sample_period)) for _ in range(streams)]
        self._tolerance = max(1, round(LARGEST_SKEW / sample_period))
        self._origin: tuple[int, int] | None = None
        self._next, self._has_begun = 0, False

    @property
    def lost(self) -> int:
        """Number of samples of all streams that were lost on the way."""
        return sum(stream.check.lost for stream in self._streams)

    @property
    def repeated(self) -> int:
        """Number of samples of all streams that came twice or too late."""
        return sum(stream.check.repeated for stream in self._streams)

    def add(self, number: int, block: SampleBlock) -> None:
        """Append the next block of a stream.

        Parameters
        ----------
        number : int
            Of the stream, from 0.
        block : SampleBlock
            With at least one sample.

        Raises
        ------
        RecordError
            If it has another sample period; the block is then treated as lost.
        """
        period = block.sample_period
        if period is not None and abs(period / self.sample_period - 1.0) > PERIOD_TOLERANCE:
            raise RecordError(
                f"samples: got the sample period {period:g} s, expected {self.sample_period:g} s as the model has"
            )
        stream = self._streams[number]
        arrival = stream.check.join(int(block.index[0]), _time(block), block.size, block.follows_gap)
        block = block.after(arrival.repeated)
        if not block.size:
            return
        by_index, by_time = stream.end + arrival.missing, self._number_at(_time(block))
        if arrival.restarted and by_time < self._next - round(LONGEST_DELAY / self.sample_period):
            self._begin()
            by_time = self._number_at(_time(block))
        moved = abs(by_index - by_time) > self._tolerance
        self.rejoined += moved and not arrival.restarted
        first = by_time if arrival.restarted or moved else by_index
        if number == 0:
            self._origin = (first, _time(block))
        stream.waiting.append((first, block))
        stream.end = first + block.size
        stream.drop_before(stream.end - round(LONGEST_WAIT / self.sample_period))

    def take(self) -> Iterator[JoinedBlock]:
        """The samples that every stream has by now, in blocks without a gap; they are returned once."""
        while all(stream.waiting for stream in self._streams):
            first = max(self._next, *(stream.waiting[0][0] for stream in self._streams))
            for stream in self._streams:
                stream.drop_before(first)
            fronts = [stream.waiting[0] for stream in self._streams if stream.waiting]
            if len(fronts) < len(self._streams) or any(number != first for number, _ in fronts):
                continue
            size = min(block.size for _, block in fronts)
            parts = tuple(block.between(0, size) for _, block in fronts)
            for stream in self._streams:
                stream.drop_before(first + size)
            restarted, missing = not self._has_begun, first - self._next if self._has_begun else 0
            self._next, self._has_begun = first + size, True
            self.joined += size
            yield JoinedBlock(parts, missing, restarted)

    def _begin(self) -> None:
        for stream in self._streams:
            stream.waiting.clear()
        self._origin = None
        self._next, self._has_begun = 0, False

    def _number_at(self, time: int) -> int:
        """Number of the sample at a time [ns]; the first time that is asked for gets 0."""
        if self._origin is None:
            self._origin = (0, time)
        number, at = self._origin
        return number + round((time - at) * 1e-9 / self.sample_period)


def _time(block: SampleBlock) -> int:
    """Time of the first sample [ns]."""
    return block.stamp + round(float(block.time[0]) * 1e9)
