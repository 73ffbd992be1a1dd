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

from dataclasses import replace

import numpy as np

from ...record import CONDITIONING, Experiment, Notice, Record

AT_THE_END = 0.02
"""Largest distance from an end of the drive range that counts as reaching it, as a share of the range."""
LONGEST = 0.5
"""Largest share of a record that is used for conditioning."""


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


def covers(lead: Record, record: Record) -> bool:
    """True if the drive of `lead` has been at both ends of the drive range of `record`."""
    near = AT_THE_END * float(np.ptp(record.voltage))
    low, high = float(lead.voltage.min()), float(lead.voltage.max())
    return low <= float(record.voltage.min()) + near and high >= float(record.voltage.max()) - near


def known_from_within(experiment: Experiment) -> tuple[Experiment, tuple[Notice, ...]]:
    """Cut every truncated record in two: a conditioning phase up to the first full loop, and the continuing rest.

    Returns
    -------
    experiment : Experiment
        The same samples.
    notices : tuple of Notice
        ``conditioning_length`` for every record that was cut.
    """
    records: list[Record] = []
    notices: list[Notice] = []
    for record in experiment:
        before = records[-1] if records and record.continues else None
        if before is not None and before.phase == CONDITIONING and before.truncated and not covers(before, record):
            record = replace(record, truncated=True)
        samples = conditioning_length(record) if record.truncated and record.phase != CONDITIONING else 0
        if samples:
            records.append(replace(record[:samples], phase=CONDITIONING))
            record = replace(record[samples:], truncated=False)
            message = f"the initial state is unknown; the first {samples} samples, up to a full loop, are not fitted"
            notices.append(Notice("conditioning_length", message, record.phase))
        records.append(record)
    return replace(experiment, records=tuple(records)), tuple(notices)
