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

"""`with_conditioning`: selected records, together with the records before them that determine the initial state."""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np

from ...record import Record

FOLLOWED = 2000
"""Number of samples at the end of a path that stay as they are, so that the dynamics follow them."""


def with_conditioning(records: Sequence[Record], wanted: Collection[int]) -> list[int]:
    """Indices of the records `wanted`, and of the records before them that they continue; in order."""
    needed: set[int] = set()
    for index in wanted:
        needed.add(index)
        while records[index].continues and index > 0:
            index -= 1
            needed.add(index)
    return sorted(needed)


def records_to_fit(
    records: Sequence[Record], floors: Sequence[float], wanted: Collection[int]
) -> tuple[list[Record], list[float]]:
    """Records for a fit, and their noise floors.

    A record that only determines the state of the next one has an infinite floor, hence no weight.

    Parameters
    ----------
    records : sequence of Record
        All records of the experiment, in order.
    floors : sequence of float
        Noise floor of every record [m].
    wanted : collection of int
        Indices of the records to fit.
    """
    kept = with_conditioning(records, wanted)
    return [records[i] for i in kept], [floors[i] if i in wanted else np.inf for i in kept]


def path_of(record: Record, most: int) -> tuple[Record, ...]:
    """A record that only determines the state of the next one, with about `most` samples.

    Every block of samples is replaced by its smallest and its largest drive, in the order in which they come, because a
    hysteresis loop remembers the turns of the drive, and creep its mean. The last samples stay as they are.

    Parameters
    ----------
    record : Record
        Record that is not compared with a model.
    most : int
        Number of samples.

    Returns
    -------
    tuple of Record
        The blocks and the last samples, which continue them; the record itself if it is hardly longer than `most`.
    """
    factor = 2 * (record.size // most)
    blocks = (record.size - FOLLOWED) // max(factor, 1)
    if factor < 4 or blocks < 1:
        return (record,)
    head = record[: blocks * factor]
    drive = head.voltage.reshape(blocks, factor)
    extremes = np.sort((drive.argmin(axis=1), drive.argmax(axis=1)), axis=0) + factor * np.arange(blocks)
    turns, period = extremes.T.ravel(), 0.5 * factor * record.sample_period
    coarse = head.with_channels(lambda c: c[turns], sample_period=period, initial_voltage=record.settled_voltage)
    return coarse, record[head.size :]
