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

"""`once_per_record`: what was found in a record is kept as long as the record, which cannot be changed."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import TypeVar
from weakref import WeakKeyDictionary

from ...record import Record

Found = TypeVar("Found")


def once_per_record(find: Callable[[Record], Found]) -> Callable[[Record], Found]:
    """The function, evaluated once for every record.

    Examples
    --------
    >>> read = []
    >>> size = once_per_record(lambda record: read.append(record.size) or record.size)
    >>> record = Record([0.0, 1.0], [0.0, 2e-6], 1e-3)
    >>> size(record), size(record), read
    (2, 2, [2])
    """
    known = WeakKeyDictionary[Record, Found]()

    @wraps(find)
    def kept(record: Record) -> Found:
        if record not in known:
            known[record] = find(record)
        return known[record]

    return kept
