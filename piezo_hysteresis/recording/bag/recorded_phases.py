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

"""`records_of`: makes records from the segments of a bag: names, averages, and splits them at lost samples."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from ...errors import RecordingError
from ...record import Notice, Record
from ..checks.split_at_gaps import LARGEST, split_at_gaps
from ..segmentation.decimating_buffer import averaged_notice, left_out_notice
from ..segmentation.phases import labelled
from ..segmentation.segment import Segment
from ..segmentation.waveform import phase_name
from ..table.read_options import HOLD, IDLE, LEFT_OUT, ReadOptions
from .phase_topic import PhaseNames

_MOVED = 0.01
"""Share of the largest movement below which a segment counts as rest."""
_SEVERE_SHARE = 0.05
"""Share of lost samples from which a phase cannot be trusted."""


def records_of(
    segments: list[Segment], averages: list[int], names: PhaseNames, options: ReadOptions
) -> tuple[list[Record], list[Notice]]:
    """Records of a bag from its segments, and the findings.

    Parameters
    ----------
    segments : list of Segment
        In the order in which they were recorded.
    averages : list of int
        Number of samples that are averaged into one, for every segment.
    names : PhaseNames
        Names of the phase numbers.
    options : ReadOptions
        Which phases to keep, and how to name them.

    Raises
    ------
    RecordingError
        If no phase is left.
    """
    unlabelled = options.phases is not None or (not names and all(s.phase == 0 for s in segments))
    records: list[Record] = []
    notices: list[Notice] = []
    short: list[int] = []
    moving = _MOVED * max(_travel(segment) for segment in segments)
    before: Segment | None = None
    kept = excited = unknown = False
    for segment, average in zip(segments, averages, strict=True):
        if segment.first:
            before, kept, excited, unknown = None, False, False, False
        slow = segment.averaged(average)
        name = "record" if unlabelled else _name(slow if slow.size else segment, names, notices)
        moves = _travel(segment) > moving
        left_out = name in LEFT_OUT and name not in options.include and not (name == HOLD and moves and kept)
        notices += _interruptions(segment, name, left_out)
        if left_out and moves:
            text = (
                f"the drive moved by {_travel(segment):.3g} V before the first phase; the stage is "
                "assumed to have settled afterwards"
            )
            notices.append(Notice("moved", text, name))
        if not left_out:
            begins = segment.phase == 0 if segment.first else slow.lost == 0 and not unknown
            if excited and not kept:
                notices.append(
                    Notice("history", "earlier phases were not recorded; the stage is assumed to have settled", name)
                )
            if not slow.size:
                notices.append(left_out_notice(segment.size, average, name))
                short.append(segment.size)
                continue
            if len(segments) > 1 and not _has_measured(slow):
                text = f"none of its {segment.size} samples is finite; the phase was left out"
                notices.append(Notice("non_finite", text, name))
                unknown = True
                continue
            if options.average is None and average > 1:
                notices.append(averaged_notice(average, slow.sample_period, name))
            parts, more_notices = split_at_gaps(
                slow.channels,
                slow.sample_period,
                slow.breaks,
                slow.pauses,
                phase=name,
                start_time=slow.start_time,
                continues=kept,
                truncated=not begins,
                initial_voltage=float(before.channels["voltage"][-1]) if before and begins and not kept else None,
            )
            if not begins:
                notices.append(
                    Notice("truncated", "its beginning was not recorded; the initial state is unknown", name)
                )
            records += parts
            notices += more_notices
            kept, unknown = True, False
        excited |= name != IDLE
        before = segment
    if not records and unknown:
        raise RecordingError("holds no phase with a finite sample, expected voltages and displacements")
    if not records and short:
        raise RecordingError(f"`average`: got {options.average}, expected at most {max(short)} samples")
    if not records:
        raise RecordingError(f"holds only {IDLE} and {HOLD}, expected phases; `include` keeps those")
    origin = records[0].start_time
    records = [replace(r, start_time=r.start_time - origin) for r in records]
    if unlabelled:
        records, more_notices = labelled(records, options.phases)
        notices += more_notices
    return records, notices


def _interruptions(segment: Segment, name: str, left_out: bool) -> Iterator[Notice]:
    """What was lost of a segment, and where its device did not measure."""
    if missing := segment.lost + sum(segment.breaks.values()):
        lost = f"{missing} samples ({missing * segment.sample_period:.3g} s) were lost"
        places = len(segment.breaks) + (segment.lost > 0)
        severe = not left_out and missing > _SEVERE_SHARE * (segment.size + missing)
        yield Notice("gap", f"{lost} in {places} places", name, severe)
    if paused := sum(n for at, n in segment.pauses.items() if at):
        held = f"{paused} samples ({paused * segment.sample_period:.3g} s) were not measured"
        yield Notice("pause", f"{held} while the device held its voltage and its memory was read", name)


def _has_measured(segment: Segment) -> bool:
    """Whether drive and displacement are numbers together in any sample."""
    voltage, displacement = segment.channels["voltage"], segment.channels["displacement"]
    return bool(((np.abs(voltage) < LARGEST) & (np.abs(displacement) < LARGEST)).any())


def _travel(segment: Segment) -> float:
    """Range of the drive [V]."""
    voltage = segment.channels["voltage"]
    return float(np.ptp(voltage)) if np.isfinite(voltage).all() else 0.0


def _name(segment: Segment, names: PhaseNames, notices: list[Notice]) -> str:
    """Recorded name of a segment, or a proposed one."""
    name = names.at(segment.phase, segment.received_ns) or (IDLE if segment.phase == 0 else "")
    if not name:
        name = phase_name(segment.channels["voltage"], segment.sample_period)
        notices.append(
            Notice("proposed", f"phase number {segment.phase} has no recorded name; '{name}' is assumed", name)
        )
    return name
