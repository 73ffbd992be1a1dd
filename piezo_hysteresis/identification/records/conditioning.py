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
