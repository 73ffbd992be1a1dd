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
from .sequence_check import SequenceCheck

LARGEST_SKEW = 2e-3
"""Change of the stamps of a stream against those of another, above which all are joined anew [s]; at least a sample.
Drivers correct their stamps by 1 ms."""

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
        True for the first block, and after the streams were joined anew.
    follows_gap : bool
        True where no stream measured the missing samples.
    """

    blocks: tuple[SampleBlock, ...]
    missing: int
    restarted: bool
    follows_gap: bool

    @property
    def is_undriven(self) -> bool:
        """True where no stage has been driven since its driver began."""
        return all(block.index[0] == 0 or block.phase[0] == 0 for block in self.blocks)


@dataclass(eq=False, slots=True)
class _Stream:
    """One stream: samples that wait for the others, each block with the number of its first sample."""

    check: SequenceCheck
    waiting: deque[tuple[int, SampleBlock]] = field(default_factory=deque)
    end: int | None = None
    skew: float = 0.0
    since: tuple[int, int] | None = None
    period: float | None = None

    def add(self, first: int, block: SampleBlock, most: int) -> None:
        """Append a block, and drop old ones beyond a number of samples; the new one stays."""
        self.waiting.append((first, block))
        self.end = first + block.size
        while len(self.waiting) > 1 and self.end - self.waiting[1][0] >= most:
            self.waiting.popleft()

    def drop_before(self, number: int) -> None:
        """Drop the samples before a number."""
        while self.waiting and self.waiting[0][0] < number:
            first, block = self.waiting.popleft()
            if first + block.size > number:
                self.waiting.appendleft((number, block.between(number - first, block.size)))

    def forget(self) -> None:
        """Drop all samples, and the relation to the other streams."""
        self.waiting.clear()
        self.end = None


class AxesJoiner:
    """Numbers the samples of all streams by their time, and returns those that every stream has.

    The stamps relate the streams where they begin; from there on, the running index numbers the samples. All streams
    are joined anew if one is restarted, or if its stamps move against those of another by more than `LARGEST_SKEW` and
    one sample. Two streams are joined as exactly as their stamps are, and to half a sample at best. The stamps of a
    single stream do not matter.

    Parameters
    ----------
    streams : int
        Number of streams.
    sample_period : float
        Time between samples, the same for all streams [s].

    Attributes
    ----------
    joined : int
        Number of joined samples.
    moves : list of (int, float)
        Stream whose stamps had moved, and by how much [s], for every time that the streams were joined anew for this
        reason; whoever reports them clears the list.

    Raises
    ------
    RecordError
        If the sample period is outside the limits of a stream.
    """

    def __init__(self, streams: int, sample_period: float) -> None:
        self.sample_period, self.joined = sample_period, 0
        self.moves: list[tuple[int, float]] = []
        self._streams = [_Stream(SequenceCheck(sample_period)) for _ in range(streams)]
        self._origin: int | None = None
        self._next: int | None = None
        self._dropped = False

    @property
    def lost(self) -> int:
        """Number of samples of all streams that were lost on the way."""
        return sum(stream.check.lost for stream in self._streams)

    @property
    def repeated(self) -> int:
        """Number of samples of all streams that came twice or too late."""
        return sum(stream.check.repeated for stream in self._streams)

    @property
    def apart(self) -> float:
        """Time between the newest samples of the streams, by their stamps [s]; 0 where one has none."""
        ends = [stream.end for stream in self._streams]
        known = [end for end in ends if end is not None]
        return (max(known) - min(known)) * self.sample_period if len(known) == len(ends) else 0.0

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
        stream = self._streams[number]
        self._require_period(stream, block)
        arrival = stream.check.join(int(block.index[0]), _time(block), block.size, block.follows_gap)
        block = block.after(arrival.repeated)
        if not block.size:
            return
        time = _time(block)
        if arrival.restarted and stream.end is not None:
            self._begin()
        elapsed = self._elapsed(time)
        others = [s.skew for s in self._streams if s is not stream and s.end is not None]
        drift = others[0] if others else 0.0  # of the clocks against the numbers, since the streams began
        first = round((elapsed - drift) / self.sample_period) if stream.end is None else stream.end + arrival.missing
        stream.skew = elapsed - first * self.sample_period
        move = max((stream.skew - other for other in others), key=abs, default=0.0)
        if abs(move) > max(LARGEST_SKEW, self.sample_period):
            self.moves.append((number, move))
            self._begin()
            first, stream.skew = 0, self._elapsed(time)
        stream.add(first, block, round(LONGEST_WAIT / self.sample_period))

    def take(self) -> Iterator[JoinedBlock]:
        """The samples that every stream has by now, in blocks without a gap; they are returned once."""
        while all(stream.waiting for stream in self._streams):
            first = max(stream.waiting[0][0] for stream in self._streams)
            self._dropped |= any(stream.waiting[0][0] < first for stream in self._streams)
            for stream in self._streams:
                stream.drop_before(first)
            fronts = [stream.waiting[0] for stream in self._streams if stream.waiting]
            if len(fronts) < len(self._streams) or any(number != first for number, _ in fronts):
                continue
            size = min(block.size for _, block in fronts)
            parts = tuple(block.between(0, size) for _, block in fronts)
            for stream in self._streams:
                stream.drop_before(first + size)
            restarted, missing = self._next is None, 0 if self._next is None else first - self._next
            follows_gap = not self._dropped and all(block.follows_gap for block in parts)
            self._next, self._dropped = first + size, False
            self.joined += size
            yield JoinedBlock(parts, missing, restarted, follows_gap)

    def _begin(self) -> None:
        for stream in self._streams:
            stream.forget()
        self._origin = self._next = None

    def _elapsed(self, time: int) -> float:
        """Time since the first one after the streams began [s]; `time` in ns."""
        if self._origin is None:
            self._origin = time
        return (time - self._origin) * 1e-9

    def _require_period(self, stream: _Stream, block: SampleBlock) -> None:
        """Refuse another sample period; that of single samples follows from their stamps, about once a second."""
        period, tolerance = block.sample_period, PERIOD_TOLERANCE
        if period is None:
            index, time = int(block.index[0]), _time(block)
            since = stream.since or (index, time)
            steps, elapsed = (index - since[0]) % 2**32, (time - since[1]) * 1e-9
            if steps >= 2**31 or elapsed < 0:
                steps, elapsed, since = 0, 0.0, (index, time)
            stream.since = since
            if steps and elapsed >= max(1.0, 2.0 * self.sample_period):
                stream.since, stream.period = (index, time), elapsed / steps
                tolerance = LARGEST_SKEW / elapsed
            period = stream.period
        else:
            stream.since, stream.period = None, None
        if period is not None:
            require_period(period, self.sample_period, max(tolerance, PERIOD_TOLERANCE))


def require_period(period: float, expected: float, tolerance: float = PERIOD_TOLERANCE) -> None:
    """Raise RecordError for samples of another period than that of the model [s]."""
    if abs(period / expected - 1.0) > tolerance:
        raise RecordError(f"got the sample period {period:g} s, expected {expected:g} s as the model has")


def _time(block: SampleBlock) -> int:
    """Time of the first sample [ns]."""
    return block.stamp + round(float(block.time[0]) * 1e9)
