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

"""The conditioning part of a record that begins in an unknown state, up to its first full loop.

After the drive has been at both ends of its range, the hysteresis does not depend on the past. The samples up to there
determine the state and are not fitted; all later samples are.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ...record import CONDITIONING, Experiment, Notice, Record

AT_THE_END = 0.02
"""Largest distance from an end of the drive range that counts as reaching it, as a share of the range."""
LONGEST = 0.5
"""Largest share of a record that is used for conditioning."""
MOST_UNUSED = 0.5
"""Share of the samples in records of unknown state from which a result is doubtful."""
NOT_USED = "not_used"
"""Kind of the notice about records whose state stays unknown."""
MOST_NAMED = 12
"""Largest number of phases that a notice lists."""


def conditioning_length(record: Record) -> int:
    """Number of samples until the drive has been at both ends of its range; 0 if too few would remain.

    Examples
    --------
    >>> drive = np.sin(2 * np.pi * np.arange(1000) / 200)
    >>> 140 < conditioning_length(Record(drive, drive, 1e-3)) < 150
    True
    """
    u = record.voltage
    near = AT_THE_END * float(np.ptp(u))
    if near == 0.0:
        return 0
    samples = 1 + max(int(np.argmax(u <= u.min() + near)), int(np.argmax(u >= u.max() - near)))
    return samples if samples <= LONGEST * record.size else 0


def covers(lead: Sequence[Record], record: Record) -> bool:
    """True if the drive of the records `lead` has been at both ends of the drive range of `record`."""
    near = AT_THE_END * float(np.ptp(record.voltage))
    low = min(float(r.voltage.min()) for r in lead)
    high = max(float(r.voltage.max()) for r in lead)
    return low <= float(record.voltage.min()) + near and high >= float(record.voltage.max()) - near


def known_from_within(experiment: Experiment) -> tuple[Experiment, tuple[Notice, ...]]:
    """Find the records whose initial state the drive before them determines; cut the other truncated ones in two.

    A truncated record that continues another one without a gap is known if the drive has been at both ends of its
    range since the state was lost. Otherwise it is cut into a conditioning phase up to the first full loop, and the
    continuing rest.

    Returns
    -------
    experiment : Experiment
        The same samples.
    notices : tuple of Notice
        ``conditioning_length`` for every record that was cut, and ``not_used`` for those that stay unknown.
    """
    records: list[Record] = []
    notices: list[Notice] = []
    lead: list[Record] = []  # since the state was lost
    for given in experiment:
        record = given
        if lead and _follows(lead[-1], record):
            record = replace(record, truncated=not covers(lead, record))
        else:
            lead = []
        samples = conditioning_length(record) if record.truncated and record.phase != CONDITIONING else 0
        if samples:
            records.append(replace(record[:samples], phase=CONDITIONING))
            record = replace(record[samples:], truncated=False)
            message = f"the initial state is unknown; the first {samples} samples, up to a full loop, are not fitted"
            notices.append(Notice("conditioning_length", message, record.phase))
        records.append(record)
        lead = [*lead, given] if given.truncated else []
    return replace(experiment, records=tuple(records)), (*notices, *_not_used(records))


def _follows(before: Record, record: Record) -> bool:
    """Whether a record continues a truncated one without a gap, so that its state is not known by itself."""
    if not record.continues or (before.phase == CONDITIONING and not record.truncated):
        return record.continues
    end = before.start_time + before.duration
    return record.truncated and abs(record.start_time - end) < 0.5 * before.sample_period


def _not_used(records: Sequence[Record]) -> list[Notice]:
    """Notice about the records whose state stays unknown; they are used only if no other record moves."""
    whole = [r for r in records if r.phase != CONDITIONING]
    unknown = [r for r in whole if r.truncated]
    if not unknown or not any(np.ptp(r.voltage) > 0.0 for r in whole if not r.truncated):
        return []
    share = sum(r.size for r in unknown) / sum(r.size for r in whole)
    what = f"{len(unknown)} of {len(whole)} phases, {100 * share:.2g} % of the samples, "
    names = ", ".join(r.phase for r in unknown[:MOST_NAMED]) + (", …" if len(unknown) > MOST_NAMED else "")
    text = f"{what}were not used, because the state of the stage at their start is unknown: {names}"
    return [Notice(NOT_USED, text, severe=share > MOST_UNUSED)]
