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

"""The jump at the beginning of a record: a step experiment in a slow record, which shows delay and lag.

At a single frequency a lag and a narrow play have the same influence on the loop. Only the first samples after a jump
distinguish them. They are few, and therefore form a separate block with its own weight.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np

from ...record import Record
from .noise import travel

Blocks = tuple[Sequence[Record], Sequence[float], Collection[int]]
"""Records in order, the floor of each [m], and the indices of those to fit."""

SUDDEN = 10.0
"""Smallest ratio of the slope of a jump to the usual slope of the drive."""
LARGE = 0.05
"""Smallest height of a jump, as a share of the drive range."""
FEWEST = 8
"""Smallest number of samples after the step."""
WEIGHT = 1 / 16
"""Weight of a jump relative to that of its record."""


def step_length(record: Record) -> int:
    """Samples from the jump at the beginning of a record until the drive has moved as far again; 0 without a jump.

    Examples
    --------
    >>> drive = 1.0 + np.arange(400) / 128
    >>> step_length(Record(drive, drive, 0.01, initial_voltage=0.0))
    128
    """
    if not begins_with_a_jump(record):
        return 0
    jump = abs(float(record.voltage[0]) - record.settled_voltage)
    speed = np.abs(np.diff(record.voltage))
    length = 1 + int(np.searchsorted(np.cumsum(speed), jump))
    return length if FEWEST <= length < record.size - FEWEST else 0


def begins_with_a_jump(record: Record) -> bool:
    """True if the first voltage is far from the settled one, compared with the speed and the range of the drive."""
    jump = abs(float(record.voltage[0]) - record.settled_voltage)
    speed = np.abs(np.diff(record.voltage))
    return bool(speed.size and jump > 0.0 and jump >= max(SUDDEN * float(np.median(speed)), LARGE * travel(record)))


def steps_apart(records: Sequence[Record], floors: Sequence[float], fitted: Collection[int]) -> Blocks:
    """Records, floors and indices to fit, with the jump of every fitted record as a separate block.

    Parameters
    ----------
    records : sequence of Record
        The experiment, in order.
    floors : sequence of float
        Floor of every record [m]; that of a jump is increased, so that its relative weight is `WEIGHT`.
    fitted : collection of int
        Indices of the records to fit.
    """
    parts: list[Record] = []
    sizes: list[float] = []
    wanted: list[int] = []
    for index, (record, floor) in enumerate(zip(records, floors, strict=True)):
        length = 0 if record.continues or index not in fitted else step_length(record)
        if length:
            wanted.append(len(parts))
            parts.append(record[:length])
            sizes.append(floor / WEIGHT**0.5)
            record = record[length:]
        if index in fitted:
            wanted.append(len(parts))
        parts.append(record)
        sizes.append(floor)
    return parts, sizes, wanted
