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

"""`RecordPiece`: a part of a record with one rate and one amplitude of the drive, or the step or the hold before it."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np

from ...record import Record, Samples
from ..records.excitation_content import RINGS
from ..records.leading_step import step_length
from ..records.sampling import is_faster
from ..records.steady_waves import find_turns

SWING = 0.005
"""A turning point counts if the drive goes back by this share of its range; noise does not."""
PER_DECADE = 2
"""Number of classes of the rate per decade."""
AMPLITUDES = 3
"""Number of classes of the amplitude, equally spaced up to the largest one."""
FEWEST = 32
"""Smallest number of samples in a piece."""
MOST = 24
"""Number of pieces from which a record is cut into equal pieces instead, because its drive has no single rates."""
MOST_STEPS = 100
"""Largest number of steps of a record that become pieces; of more steps, every second, third, … is used."""
EQUAL = 5
"""Number of equal pieces into which such a record is cut."""
JUMP = 0.01
"""A change of the drive between two samples is a step if it is larger than this share of the range, and then held."""
STILL = 1e-3
"""The drive counts as held while it stays within this share of its range."""


class Kind(StrEnum):
    """What the drive does in a piece."""

    STEP = "step"
    """It jumps, and the stage rings."""
    HOLD = "hold"
    """It stays at the level of the step, and the stage creeps."""
    LOOP = "loop"
    """It moves up and down at one rate and amplitude."""
    CONDITIONING = "conditioning"
    """Anything that only determines the state of the stage and is not fitted: a record, or the step of a slow one."""


WEIGHTS = {Kind.STEP: 0.1, Kind.HOLD: 0.5, Kind.LOOP: 1.0, Kind.CONDITIONING: 0.0}
"""Usual weight in a fit, so that a ringing mode does not outweigh the creep after it, nor one level all loops."""


@dataclass(frozen=True, eq=False, slots=True)
class RecordPiece:
    """A part of a record.

    Parameters
    ----------
    record : Record
        Samples of the piece; it continues the piece before it.
    origin : int
        Index of the record that it was cut from.
    kind : Kind
        What the drive does.
    rate : int
        Class of the rate, for loops.
    amplitude : int
        Class of the amplitude, for loops.
    run : int
        Number of the run of records that continue one another; they share a sensor zero.
    share : float
        Share of the usual weight of its kind that it has in a fit, 0 to 1.
    """

    record: Record
    origin: int
    kind: Kind
    rate: int = 0
    amplitude: int = 0
    run: int = 0
    share: float = 1.0

    @property
    def weight(self) -> float:
        """Weight in a fit, relative to the other pieces of the record."""
        return WEIGHTS[self.kind] * self.share


_Edge = tuple[int, Kind, int, int]
"""End of a piece, what the drive does in it, and the classes of its rate and its amplitude."""


def pieces_of(records: Sequence[Record], fitted: Collection[int]) -> list[RecordPiece]:
    """Cut every record into pieces. Records that are not in `fitted` only determine the state of the stage.

    So do steps of a record that is slower than another one with a step: of the fast dynamics they show nothing that the
    faster samples do not show better, and the model predicts slow samples of a step only as those of a delayed ramp.

    Parameters
    ----------
    records : sequence of Record
        In order.
    fitted : collection of int
        Indices of the records to cut.
    """
    largest = max(float(np.ptp(np.append(records[i].voltage, records[i].settled_voltage))) for i in fitted)
    found: list[RecordPiece] = []
    run = -1
    for index, record in enumerate(records):
        run += index == 0 or not record.continues
        if index in fitted:
            before = float(records[index - 1].voltage[-1]) if record.continues and index else record.settled_voltage
            found += _cut(record, index, run, largest, before)
        else:
            found.append(RecordPiece(record, index, Kind.CONDITIONING, run=run))
    found = _without_slow_steps(found)
    if any(p.kind is Kind.LOOP for p in found):
        return found
    # without any loop, the levels of the steps are what can be left out
    return [replace(p, kind=Kind.LOOP) if p.kind is Kind.HOLD else p for p in found]


def _without_slow_steps(pieces: list[RecordPiece]) -> list[RecordPiece]:
    """The pieces, where slow steps beside faster ones are not fitted, unless nothing else of their record would be."""
    steps = [p.record for p in pieces if p.kind is Kind.STEP]
    moving = {p.origin for p in pieces if p.kind in (Kind.HOLD, Kind.LOOP)}
    return [
        replace(p, kind=Kind.CONDITIONING)
        if p.kind is Kind.STEP and p.origin in moving and any(is_faster(s, p.record.sample_period) for s in steps)
        else p
        for p in pieces
    ]


def _cut(record: Record, index: int, run: int, largest: float, before: float) -> list[RecordPiece]:
    edges: list[_Edge] = []
    done = 0
    for start, ringing, stop in _steps(record, largest, before):
        edges += _moving(record, done, start, largest)
        edges.append((ringing, Kind.STEP, 0, 0))
        if stop > ringing:
            edges.append((stop, Kind.HOLD, 0, 0))
        done = stop
    edges += _moving(record, done, record.size, largest)
    edges[-1] = (record.size, *edges[-1][1:])
    parts = record.split(*(end for end, *_ in edges[:-1]))
    return [
        RecordPiece(part, index, kind, rate, size, run)
        for part, (_, kind, rate, size) in zip(parts, edges, strict=True)
    ]


def _steps(record: Record, largest: float, before: float) -> list[tuple[int, int, int]]:
    """First sample, end of the ringing and end of the hold of every jump after which the drive is held."""
    u = record.voltage
    jumps = np.flatnonzero(np.abs(np.diff(u, prepend=before)) > JUMP * largest)
    long = jumps[np.diff(jumps, append=u.size) >= FEWEST]
    found = []
    for jump in long[:: 1 + long.size // MOST_STEPS].tolist():
        if np.ptp(u[jump : jump + FEWEST]) > 2.0 * STILL * largest:
            continue
        leaves = np.abs(u[jump:] - u[jump]) > STILL * largest
        held = int(leaves.argmax()) if leaves.any() else leaves.size
        first = min(held // 4, max(FEWEST, round(RINGS / record.sample_period)))
        if first >= FEWEST:
            found.append((jump, jump + first, jump + held))
    if jumps.size and jumps[0] == 0 and (not found or found[0][0] > 0):
        length = 0 if record.continues else step_length(record)
        found = [(0, length, length), *(f for f in found if f[0] >= length)] if length else found
    return found


def _moving(record: Record, start: int, stop: int, largest: float) -> list[_Edge]:
    """Pieces between two steps: a rest, or sections with one rate and one amplitude; none if it is short."""
    u = record.voltage[start:stop]
    if u.size < (FEWEST if u.size < record.size else 1):
        return []
    if float(np.ptp(u)) <= STILL * largest:
        return [(stop, Kind.HOLD, 0, 0)]
    return [(start + end, Kind.LOOP, rate, size) for end, rate, size in _loops(record, u, largest)]


def _loops(record: Record, u: Samples, largest: float) -> list[tuple[int, int, int]]:
    """Ends of the sections with one rate and one amplitude, and the classes of both."""
    turns = np.empty(u.size, np.int64)
    count = find_turns(u, SWING * largest, False, turns)
    edges = np.concatenate((turns[:count], [u.size - 1]))
    starts = np.concatenate(([0], edges[:-1]))
    times = np.maximum(edges - starts, 1) * record.sample_period
    spans = np.abs(u[edges] - u[starts])
    rates = np.round(PER_DECADE * np.log10(0.5 / times)).astype(int)
    # a difference of one swing is not another rate
    inner = np.median((rates[:-2], rates[1:-1], rates[2:]), axis=0)
    rates = np.concatenate(([rates[:2].mean()], inner, [rates[-2:].mean()]))[: rates.size].astype(int)
    sizes = np.minimum((AMPLITUDES * spans / largest).astype(int), AMPLITUDES - 1)
    found: list[tuple[int, int, int]] = []
    for end, rate, size in zip((edges + 1).tolist(), rates.tolist(), sizes.tolist(), strict=True):
        before = found[-2][0] if len(found) > 1 else 0
        if found and (found[-1][1:] == (rate, size) or found[-1][0] - before < FEWEST):
            found[-1] = (end, rate, size)
        else:
            found.append((end, rate, size))
    if len(found) > 1 and found[-1][0] - found[-2][0] < FEWEST:
        end = found.pop()[0]
        found[-1] = (end, *found[-1][1:])
    if len(found) > MOST:
        found = [(u.size, int(np.median(rates)), 0)]
    return _with_parts(found)


def _with_parts(found: list[tuple[int, int, int]]) -> list[tuple[int, int, int]]:
    """A section longer than all others together, cut into equal parts."""
    parts, begin = list[tuple[int, int, int]](), 0
    for end, rate, size in found:
        count = EQUAL if end - begin > found[-1][0] / 2 and end - begin >= EQUAL * FEWEST else 1
        parts += [(begin + (k + 1) * (end - begin) // count, rate, size) for k in range(count)]
        begin = end
    return parts
