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

"""`Extent`: the ranges that an experiment covers. An effect derives its start values from them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np

from ..record import Record

MAINS = (50.0, 60.0)
"""Nominal mains frequencies [Hz]."""
ROOM = 293.15
"""Temperature if none was recorded [K]."""


@dataclass(frozen=True, slots=True)
class Extent:
    """Ranges covered by the records of an experiment.

    Parameters
    ----------
    voltage_min, voltage_max : float
        Range of the drive voltage [V].
    max_slew : float
        Largest rate of change of the drive between two samples [V/s].
    voltage_scale : float
        v = u / voltage_scale [V].
    displacement_scale : float
        Displacement at normalised output 1 [m].
    fastest_period : float
        Smallest sample period [s].
    duration : float
        Time from the first to the last sample [s].
    longest_record : float
        Duration of the longest record [s].
    longest_run : float
        Longest time from the beginning of a record that starts at rest to the end of the last record that continues it
        [s].
    peaks : tuple of float
        Frequencies of peaks in the ratio of residual to displacement [Hz], highest peak first.
    mains : tuple of float
        Possible mains frequencies [Hz]: the nominal ones, or as the residuals show them.
    temperature : float
        Mean over the records with a temperature [K]; `ROOM` without such a record.
    """

    voltage_min: float
    voltage_max: float
    max_slew: float
    voltage_scale: float
    displacement_scale: float
    fastest_period: float
    duration: float
    longest_record: float
    longest_run: float
    peaks: tuple[float, ...] = ()
    mains: tuple[float, ...] = MAINS
    temperature: float = ROOM

    @property
    def span(self) -> float:
        """Range of the drive voltage [V]."""
        return self.voltage_max - self.voltage_min

    @classmethod
    def of(cls, records: Sequence[Record], voltage_scale: float, displacement_scale: float) -> Self:
        """Ranges that records cover.

        Parameters
        ----------
        records : sequence of Record
            Records in experiment order, at least one.
        voltage_scale, displacement_scale : float
            Scales of the model [V], [m].
        """
        known = [float(r.channels["temperature"].mean()) for r in records if "temperature" in r.channels]
        return cls(
            voltage_min=min(float(r.voltage.min()) for r in records),
            voltage_max=max(float(r.voltage.max()) for r in records),
            max_slew=max(float(np.abs(np.diff(r.voltage)).max(initial=0.0)) / r.sample_period for r in records),
            voltage_scale=voltage_scale,
            displacement_scale=displacement_scale,
            fastest_period=min(r.sample_period for r in records),
            duration=max(r.start_time + r.duration for r in records) - min(r.start_time for r in records),
            longest_record=max(r.duration for r in records),
            longest_run=longest_run(records),
            temperature=round(float(np.mean(known)), 2) if known else ROOM,
        )


def longest_run(records: Sequence[Record]) -> float:
    """Longest time from the start at rest to the end of the last record that continues the one before [s].

    Examples
    --------
    >>> u = np.zeros(100)
    >>> first, second = Record(u, u, 0.1), Record(u, u, 0.1, start_time=12.0, continues=True)
    >>> round(longest_run([first, first, second]), 6)
    22.0
    """
    longest = begin = 0.0
    for k, record in enumerate(records):
        if k == 0 or not record.continues:
            begin = record.start_time
        longest = max(longest, record.start_time + record.duration - begin)
    return longest
