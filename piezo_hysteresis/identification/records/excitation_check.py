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

"""What an experiment cannot show, because it does not contain the necessary kind of drive.

Every effect declares the drive that it needs as its `excitation_need`.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np

from ...effects import CATALOGUE, ExcitationNeed, ExtraDelay, ExtraResonance
from ...errors import IdentificationError
from ...record import Notice, Record
from ..structure.pieces import Kind, pieces_of
from .excitation_content import HELD, RINGS, SLOW, ExcitationContent, excitation_content
from .noise import travel
from .steady_waves import SWING, find_turns

SHORTEST_RECORD = 16
"""Fewest samples of a record that is used."""
STILL = 1e-15
"""Range of the displacement below which a stage does not move [m]; squares of far smaller ones are no numbers."""
HOLD = 1.0
"""Time for which a level must be held after a change, so that creep becomes visible [s]."""
MOVED = 0.02
"""Smallest change of level, as a share of the drive range."""
DISTINCT = 0.8
"""Ratio of the smaller to the larger amplitude below which two amplitudes count as different."""
REASONS = {
    ExcitationNeed.HELD_LEVEL: "no level is held for a second or more after a change",
    ExcitationNeed.REPEATED_PHASE: "no kind of phase was recorded twice",
    ExcitationNeed.SEVERAL_AMPLITUDES: "there are no loops of several amplitudes",
    ExcitationNeed.BROADBAND: "no drive excites the dynamics (step, noise, multisine)",
}
"""The message for each kind of drive that is missing."""
SPARSE = "the samples after the steps are too far apart for ringing"
"""The message if steps excite the dynamics, and the samples show no more than a lag."""


def missing_excitation(
    records: Sequence[Record], used: Collection[int], found: Collection[str] = ()
) -> tuple[Notice, ...]:
    """One notice for every kind of drive that the records do not contain, with the effects that need it.

    Parameters
    ----------
    records : sequence of Record
        The experiment, in order.
    used : collection of int
        Indices of the records that are used in the diagnosis.
    found : collection of str
        Public names of effects that the records have shown nevertheless; no notice names them.
    """
    chosen = [records[i] for i in used]
    span = max(float(r.voltage.max()) for r in chosen) - min(float(r.voltage.min()) for r in chosen)
    contents = [excitation_content(r) for r in chosen]
    loops = [c.is_slow and c.bandwidth > 0.0 for c in contents]  # the bandwidth of a rest is 0
    kinds = ["slow loops" if loop else r.phase.split("_")[0] for r, loop in zip(chosen, loops, strict=True)]
    steps = [p.record.sample_period for p in pieces_of(records, used) if p.kind is Kind.STEP]
    families = {e.family for e in CATALOGUE if e.public_name() in found}
    rings = ExtraResonance.family in families or min(steps, default=np.inf) <= RINGS / HELD
    present = {
        ExcitationNeed.HELD_LEVEL: any(_longest_hold(r, MOVED * span) >= HOLD for r in chosen),
        ExcitationNeed.REPEATED_PHASE: len(set(kinds)) < len(kinds),
        ExcitationNeed.SEVERAL_AMPLITUDES: _has_smaller_loops(chosen, contents),
        ExcitationNeed.BROADBAND: rings or any(c.is_broadband for c in contents),
    }
    notices = []
    for need in (n for n, is_present in present.items() if not is_present):
        names = [e.public_name() for e in CATALOGUE if e.excitation_need is need]
        reason = REASONS[need]
        if need is ExcitationNeed.BROADBAND:
            reason = SPARSE if steps else reason
            names += [] if steps or ExtraDelay.family in families else ["lags"]
        if hidden := " and ".join(name for name in dict.fromkeys(names) if name not in found):
            notices.append(Notice("not_tested", f"these data can hardly show {hidden}, because {reason}"))
    return tuple(notices)


def moves(record: Record) -> bool:
    """Whether the drive moves in a record."""
    return travel(record) > 0.0


def one_way(records: Sequence[Record], used: Collection[int]) -> tuple[Notice, ...]:
    """Notice ``one_way`` if the drive has turned back in none of the used records, nor in those that they continue."""
    least = MOVED * max(travel(records[i]) for i in used)
    low = high = rise = fall = 0.0
    for i, record in enumerate(records):
        u = record.voltage
        if not record.continues:
            low = high = record.settled_voltage
            rise = fall = 0.0
        rise = max(rise, float(np.max(u - np.minimum(low, np.minimum.accumulate(u)))))
        fall = max(fall, float(np.max(np.maximum(high, np.maximum.accumulate(u)) - u)))
        low, high = min(low, float(u.min())), max(high, float(u.max()))
        if i in used and min(rise, fall) > least:
            return ()
    message = (
        "the drive never turns back, so the hysteresis is not determined: the way back may differ from the prediction "
        "by the height of the loop; record whole loops"
    )
    return (Notice("one_way", message, severe=True),)


def check_motion(name: str, moving: Collection[Record]) -> None:
    """Check that the stage moves in some of the records in which the drive moves.

    Raises
    ------
    IdentificationError
        If there are none, or if the displacement is constant.
    """
    if not moving:
        raise IdentificationError(
            f"{name}: the drive does not move in any record that is used; expected loops, steps or noise of "
            f"{SHORTEST_RECORD} samples or more, in phases other than idle and hold"
        )
    if not any(np.ptp(r.displacement) >= STILL for r in moving):
        raise IdentificationError(
            f"{name}: the displacement never changes; expected that of a stage that is driven; check the column"
        )


def _longest_hold(record: Record, least: float) -> float:
    """Longest time at a level after a change of level [s]."""
    u = np.append(record.settled_voltage, record.voltage)
    ends = np.flatnonzero(np.append(np.diff(u) != 0.0, True))
    starts = np.append(0, ends[:-1] + 1)
    held = ends - starts > 1
    starts, ends = starts[held], ends[held]
    if starts.size == 0:
        return 0.0
    before = np.append(u[0], u[ends[:-1]])
    changed = np.abs(u[ends] - before) > least
    return float(np.max((ends - starts)[changed], initial=0)) * record.sample_period


def _has_smaller_loops(records: Sequence[Record], contents: Sequence[ExcitationContent]) -> bool:
    """True if there are loops of two amplitudes, in one record or in two: slow ones, or sines or triangles."""
    sizes: list[float] = []
    for record, content in zip(records, contents, strict=True):
        u = record.voltage
        turns = np.empty(u.size, np.int64)
        turns = turns[: find_turns(u, SWING * content.span, False, turns)]
        if turns.size < 2:  # a single loop begins and ends with the record
            moves = np.flatnonzero(np.diff(u))
            turns = np.concatenate((moves[:1], turns, moves[-1:] + 1))
        counts = content.waves | (np.diff(turns) * record.sample_period > 0.5 / SLOW)
        sizes += np.abs(np.diff(u[turns]))[counts].tolist()
    return bool(sizes) and min(sizes) < DISTINCT * max(sizes)
