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

from ...effects import CATALOGUE, ExcitationNeed
from ...errors import IdentificationError
from ...record import Notice, Record
from .excitation_content import SLOW, excitation_content

HOLD = 1.0
"""Time for which a level must be held after a change, so that creep becomes visible [s]."""
MOVED = 0.02
"""Smallest change of level, as a share of the drive range."""
DISTINCT = 0.8
"""Ratio of the smaller to the larger amplitude below which two amplitudes count as different."""
REASONS = {
    ExcitationNeed.HELD_LEVEL: ((), "no level is held for a second or more after a change"),
    ExcitationNeed.REPEATED_PHASE: ((), "no kind of phase was recorded twice"),
    ExcitationNeed.SEVERAL_AMPLITUDES: ((), "all loops have the same amplitude"),
    ExcitationNeed.BROADBAND: (("lags",), "no drive excites the dynamics (noise, multisine)"),
}
"""For each kind of drive: what it shows besides the effects that declare it, and the message if it is missing."""


def missing_excitation(records: Sequence[Record], found: Collection[str] = ()) -> tuple[Notice, ...]:
    """One notice for every kind of drive that the records do not contain, with the effects that need it.

    Parameters
    ----------
    records : sequence of Record
        Records that are used in the diagnosis.
    found : collection of str
        Public names of effects that the records have shown nevertheless; no notice names them.
    """
    span = max(float(r.voltage.max()) for r in records) - min(float(r.voltage.min()) for r in records)
    contents = [excitation_content(r) for r in records]
    loops = [c.is_slow and c.bandwidth > 0.0 for c in contents]  # the bandwidth of a rest is 0
    kinds = ["slow loops" if loop else r.phase.split("_")[0] for r, loop in zip(records, loops, strict=True)]
    present = {
        ExcitationNeed.HELD_LEVEL: any(_longest_hold(r, MOVED * span) >= HOLD for r in records),
        ExcitationNeed.REPEATED_PHASE: len(set(kinds)) < len(kinds),
        ExcitationNeed.SEVERAL_AMPLITUDES: _has_smaller_loops(records),
        ExcitationNeed.BROADBAND: any(c.is_broadband for c in contents),
    }
    notices = []
    for need in (n for n, is_present in present.items() if not is_present):
        others, reason = REASONS[need]
        names = dict.fromkeys((*(e.public_name() for e in CATALOGUE if e.excitation_need is need), *others))
        if hidden := " and ".join(name for name in names if name not in found):
            notices.append(Notice("not_tested", f"these data can hardly show {hidden}, because {reason}"))
    return tuple(notices)


def moves(record: Record) -> bool:
    """Whether the drive moves in a record."""
    return bool(np.ptp(np.append(record.voltage, record.settled_voltage)) > 0.0)


def check_motion(name: str, moving: Collection[Record]) -> None:
    """Check that the stage moves in some of the records in which the drive moves.

    Raises
    ------
    IdentificationError
        If there are none, or if the displacement is constant.
    """
    if not moving:
        raise IdentificationError(
            f"{name}: the drive does not move in any record that is used; expected loops, steps or noise of 16 samples "
            "or more, in phases other than idle and hold"
        )
    if not any(np.ptp(r.displacement) > 0.0 for r in moving):
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


def _has_smaller_loops(records: Sequence[Record]) -> bool:
    """True if there are slow loops of two amplitudes, in one record or in two."""
    sizes: list[float] = []
    for record in records:
        u = record.voltage
        steps = np.sign(np.diff(u))
        moves = np.flatnonzero(steps)
        if moves.size == 0:
            continue
        turns = moves[np.flatnonzero(np.diff(steps[moves])) + 1]
        if turns.size < 2:  # a single loop begins and ends with the record
            turns = np.concatenate((moves[:1], turns, moves[-1:] + 1))
        slow = np.diff(turns) * record.sample_period > 0.5 / SLOW
        sizes += np.abs(np.diff(u[turns]))[slow].tolist()
    return bool(sizes) and min(sizes) < DISTINCT * max(sizes)
