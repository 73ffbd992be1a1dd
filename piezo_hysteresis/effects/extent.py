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

from dataclasses import dataclass

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
        Steepest drive between two samples [V/s].
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
        From the beginning of a record that starts at rest to the end of the last record that continues it, the longest
        [s].
    peaks : tuple of float
        Frequencies of peaks in the ratio of residual to displacement [Hz], highest peak first.
    temperature : float
        Mean over the records with a temperature [K].
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
    temperature: float = ROOM

    @property
    def span(self) -> float:
        """Range of the drive voltage [V]."""
        return self.voltage_max - self.voltage_min
