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

"""Choice of the test records, which are used neither for fitting nor for choosing an effect."""

from __future__ import annotations

from collections.abc import Collection, Sequence

from ...record import Record
from ..excitation_check import moves

SHARE = 3
"""Number of records of a kind per test record."""


def choose_test_records(records: Sequence[Record], usable: Collection[int]) -> tuple[int, ...]:
    """Indices of the test records.

    If a kind of phase has at least three realisations, one in three is a test record, from the middle of the list, so
    that the extremes of amplitude and frequency are fitted. All phases named ``validation`` are test records, unless
    the drive moves in no other record.

    Parameters
    ----------
    records : sequence of Record
        The experiment.
    usable : collection of int
        Indices that may be taken.
    """
    kinds: dict[str, list[int]] = {}
    for index in usable:
        kinds.setdefault(records[index].phase.split("_")[0], []).append(index)
    validation = kinds.pop("validation", [])
    if not any(moves(records[i]) for members in kinds.values() for i in members):
        return ()
    chosen = [i for members in kinds.values() for i in members[SHARE // 2 :: SHARE][: len(members) // SHARE]]
    return tuple(sorted(chosen + validation))
