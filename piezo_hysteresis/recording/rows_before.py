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

"""Rows before the chosen ones: they bring the model into the state of the stage at the first chosen row.

Both become experiments by themselves, because phases, times and channels are found in the chosen rows alone. They are
read together, so that the lines of a text file are passed once.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from ..record import CONDITIONING, Experiment, Notice, Record
from .table.read_options import ReadOptions

AT_REST = 0.02
"""Largest difference of a voltage from that of the settled stage, as a share of the drive range."""


def with_rows_before(
    read: Callable[[Sequence[ReadOptions]], list[Experiment]], options: ReadOptions, most: int
) -> Experiment:
    """The rows that `options` choose, behind a phase ``conditioning`` of the rows before them.

    Parameters
    ----------
    read : callable
        Reads parts of one recording, one experiment for each of the options.
    options : ReadOptions
        With its `rows`. Where they begin with the first one, or are counted from the end, nothing is read before them.
        An `initial_voltage` belongs to the first row of the file, unless the row before the chosen ones is at it.
    most : int
        Largest number of rows before.
    """
    first, _ = options.from_the_beginning
    count = min(first, most)
    count -= count % (options.average or 1)
    settled = options.initial_voltage
    if not count:
        return read([options])[0]
    of_lead = options if first == count else replace(options, initial_voltage=None)
    wanted, lead = read([options, replace(of_lead, rows=(first - count, first), phases=CONDITIONING)])
    if settled is None and not wanted[0].truncated:
        return wanted
    if settled is not None and abs(lead[-1].voltage[-1] - settled) <= AT_REST * _swing(*lead, *wanted):
        return wanted
    ahead = [replace(r, phase=CONDITIONING, truncated=r.truncated or first > count) for r in lead]
    end = ahead[-1].start_time + ahead[-1].duration
    has_no_clock = wanted[0].start_time == ahead[0].start_time
    if not has_no_clock and abs(wanted[0].start_time - end) > 0.5 * wanted[0].sample_period:
        return wanted
    first_wanted = replace(wanted[0], continues=True, truncated=False, initial_voltage=None)
    later = end - wanted[0].start_time if has_no_clock else 0.0
    behind = (replace(r, start_time=r.start_time + later) for r in (first_wanted, *wanted.records[1:]))
    message = f"the {count} rows before were read to determine the initial state; they are neither fitted nor judged"
    if settled is not None:
        message += f"; the initial voltage of {settled:g} V is that of the first row of the file"
    return replace(wanted, records=(*ahead, *behind)).noting(Notice("rows_before", message, wanted[0].phase))


def _swing(*records: Record) -> float:
    """Range of the drive over all records [V]."""
    return float(np.ptp(np.concatenate([r.voltage for r in records])))
