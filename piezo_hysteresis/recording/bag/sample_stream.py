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

"""`SampleStream`: makes segments of one phase each from the blocks of the topic `samples`."""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Iterator
from itertools import accumulate
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...errors import RecordError
from ...record import Notice
from ..segmentation.segment import Segment
from ..table.column import Column, changes
from ..table.time_column import round_period
from .block_message import BlockMessage
from .driver_run import LONGEST_SILENCE, Run

PERIOD_TOLERANCE = 0.01
"""Largest relative difference of the sample periods of blocks that belong together."""

UNEVEN = 0.1
"""Deviation of a step in the times of a block from their mean, as a share of it, above which it is reported."""


class SampleStream:
    """Collects blocks; a long recording lies in temporary files (`Column`).

    Losses, repetitions and reordering are recognised by the running index, which wraps at 2³². An index that jumps back
    while time goes on means that the driver was started again.

    Parameters
    ----------
    sample_period : float, optional
        Sample period [s] that replaces the times in the blocks.
    """

    def __init__(self, sample_period: float | None = None) -> None:
        self._given_period = sample_period
        self._channels: dict[str, Column] = {}
        self._index, self._phase = Column(np.uint32), Column(np.uint32)
        self._next = 0
        self._starts: list[int] = []
        self._times_ns: list[int] = []
        self._periods: list[float] = []
        self._received_ns: list[int] = []
        self._after_pause: set[int] = set()
        self._uneven = 0

    @property
    def size(self) -> int:
        """Number of samples received."""
        return len(self._index)

    def add(self, block: BlockMessage, received_ns: int) -> None:
        """Append a block in the order of arrival; channels that other blocks have are filled with NaN."""
        begin, n = self.size, block.phase.size
        follows = (self._next + np.arange(n, dtype=np.int64)).astype(np.uint32)
        index = follows if block.index is None else block.index
        self._next = int(index[-1]) + 1
        self._index.extend(index)
        self._phase.extend(block.phase)
        for name in dict.fromkeys((*self._channels, *block.channels)):
            if name not in self._channels:
                self._channels[name] = Column(np.float64)
                self._channels[name].fill(np.nan, begin)
            self._channels[name].extend(block.channels[name] if name in block.channels else np.full(n, np.nan))
        time = block.time
        period = self._given_period or np.nan
        if self._given_period is None and time is not None and n > 1 and np.isfinite(time).all():
            period = float(time[-1] - time[0]) / (n - 1)
            self._uneven += bool(np.abs(np.diff(time) - period).max() > UNEVEN * abs(period))
        offset = float(time[0]) if time is not None and abs(time[0]) < LONGEST_SILENCE else 0.0
        if block.follows_pause:
            self._after_pause.add(begin)
        self._starts.append(begin)
        self._times_ns.append(block.stamp_ns + round(offset * 1e9))
        self._periods.append(period if period > 0 else np.nan)
        self._received_ns.append(received_ns)

    def segments(self, split_phases: bool = True) -> tuple[list[Segment], list[Notice]]:
        """Everything received, in order of the index.

        Parameters
        ----------
        split_phases : bool
            False to ignore the phase numbers.

        Returns
        -------
        segments : list of Segment
        notices : list of Notice
            Repeated and reordered samples, and new starts of the driver; losses are reported by the segments.

        Raises
        ------
        RecordError
            If the sample period cannot be determined.
        """
        segments: list[Segment] = []
        notices: list[Notice] = []
        if self._uneven:
            text = f"times within {self._uneven} of {len(self._starts)} blocks are uneven; uniform times are assumed"
            notices.append(Notice("time_base", text))
        end = 0.0
        for run in self._runs():
            if run.first and segments:
                seconds = (self._time_ns(run.pieces[0][1], run.period) - self._times_ns[0]) * 1e-9
                end = max(end, seconds)
                notices.append(Notice("restart", f"the driver was started again {end:.6g} s after the first sample"))
            segments += self._cut(run, end, split_phases, notices)
            end = segments[-1].end_time
        return segments, notices

    def _block_periods(self) -> NDArray[np.float64]:
        periods = np.array(self._periods)
        known = np.isfinite(periods)
        if not known.any():  # one sample per block: only the stamps give the period
            steps = np.diff(np.array(self._times_ns)) * 1e-9 / np.diff(np.array(self._starts))
            if not (steps > 0).any():
                raise RecordError("got no field 'time' and no stamps that grow, expected either; give `sample_period`")
            return np.full(periods.size, np.median(steps[steps > 0]))
        latest = np.maximum.accumulate(np.where(known, np.arange(periods.size), known.argmax()))
        return np.asarray(periods[latest])

    def _block_of(self, arrival: int) -> int:
        return bisect_right(self._starts, arrival) - 1

    def _time_ns(self, arrival: int, period: float) -> int:
        block = self._block_of(arrival)
        return self._times_ns[block] + round((arrival - self._starts[block]) * period * 1e9)

    def _elapsed(self, run: Run, arrival: int, period: float) -> float:
        """Time from the newest sample of a run to another one [s], by their stamps."""
        return (self._time_ns(arrival, period) - self._time_ns(run.newest, run.period)) * 1e-9

    def _runs(self) -> list[Run]:
        periods = self._block_periods()
        index = self._index.array()
        other = np.abs(np.diff(periods)) > PERIOD_TOLERANCE * periods[1:]
        jumps = changes(index, 1)
        edges = np.unique(np.concatenate(([0], jumps, np.array(self._starts, np.int64)[1:][other], [index.size])))
        runs: list[Run] = []
        for a, b in zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True):
            period = float(periods[self._block_of(a)])
            run, step = (runs[-1], _signed(int(index[a]) - runs[-1].expected)) if runs else (None, 0)
            if run is None or run.ends_before(step, period, self._elapsed(run, a, period)):
                run, step = Run(True, period, int(index[a]), int(index[a])), 0
                runs.append(run)
            elif abs(period / run.period - 1) > PERIOD_TOLERANCE:
                run = Run(False, period, run.expected, run.expected)
                runs.append(run)
            run.add(run.expected + step, a, b)
        for run in runs:
            same = periods[np.abs(periods / run.period - 1) <= PERIOD_TOLERANCE]
            run.period = round_period(float(np.median(same)))
        return runs

    def _cut(self, run: Run, begin: float, split_phases: bool, notices: list[Notice]) -> Iterator[Segment]:
        pieces, repeated = _swept(run.pieces)
        if repeated:
            notices.append(
                Notice("duplicate", f"{repeated} samples were received more than once; the first ones are used")
            )
        late = sum(b[1] < a[1] for a, b in zip(pieces, pieces[1:], strict=False))
        if late:
            notices.append(
                Notice("non_monotonic", f"{late} pieces were received out of order and were sorted by their index")
            )
        starts = [start for start, _, _ in pieces]
        origin = starts[0] if run.first else min(run.begin, starts[0])
        lost = [starts[0] - origin, *(b - _end(a) for a, b in zip(pieces, starts[1:], strict=False))]
        pausing = self._after_pause if self._marks_pauses(pieces) else set()
        offsets = [0, *accumulate(b - a for _, a, b in pieces)]
        channels = {name: _gathered(column.array(), pieces) for name, column in self._channels.items()}
        phase = _gathered(self._phase.array(), pieces)
        edges = changes(phase, 0).tolist() if split_phases else []
        for i, j in zip([0, *edges], [*edges, phase.size], strict=True):
            piece = bisect_right(offsets, i) - 1
            inside = range(piece + 1, bisect_left(offsets, j))
            within = i - offsets[piece]
            gaps = {offsets[p] - i: p for p in inside if lost[p]} | ({} if within or not lost[piece] else {0: piece})
            pauses = {at: lost[p] for at, p in gaps.items() if pieces[p][1] in pausing}
            breaks = {at: lost[p] for at, p in gaps.items() if at not in pauses}
            yield Segment(
                {name: values[i:j] for name, values in channels.items()},
                run.period,
                int(phase[i]),
                begin + (starts[piece] + within - origin) * run.period,
                self._received_ns[self._block_of(pieces[piece][1] + within)],
                breaks.pop(0, 0),
                breaks,
                pauses,
                run.first and i == 0,
            )

    def _marks_pauses(self, pieces: list[tuple[int, int, int]]) -> bool:
        """False where blocks are marked as following a pause although no sample is missing."""
        begin, end = pieces[0][1], max(b for _, _, b in pieces)
        announced = {start for start in self._after_pause if begin < start < end}
        return announced <= {a for _, a, _ in pieces}


def _signed(step: int) -> int:
    """An index difference modulo 2³² as the nearest signed one."""
    return (step + 0x80000000) % 0x100000000 - 0x80000000


def _end(piece: tuple[int, int, int]) -> int:
    start, a, b = piece
    return start + b - a


def _swept(pieces: list[tuple[int, int, int]]) -> tuple[list[tuple[int, int, int]], int]:
    """Pieces in order of their index, each sample once; and the number of samples that came again."""
    kept: list[tuple[int, int, int]] = []
    repeated = 0
    for start, a, b in sorted(pieces):
        again = min(max(0, _end(kept[-1]) - start), b - a) if kept else 0
        repeated += again
        if again < b - a:
            kept.append((start + again, a + again, b))
    return kept, repeated


def _gathered(values: NDArray[Any], pieces: list[tuple[int, int, int]]) -> NDArray[Any]:
    if len(pieces) == 1:
        return values[pieces[0][1] : pieces[0][2]]
    gathered = Column(values.dtype)
    for _, a, b in pieces:
        gathered.extend(values[a:b])
    return gathered.array()
