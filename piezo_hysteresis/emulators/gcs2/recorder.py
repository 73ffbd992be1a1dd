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

"""`Recorder`: the data recorder of an emulated controller."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...stage.description import Samples
from ...stage.gcs2.error_number import NO_RECORD_OPTION, NO_RECORDER_TABLE, OUT_OF_RANGE, TOO_FEW_RECORDED
from ..fault import Faults
from .refusal import Refusal

OPTIONS = {0: "Nothing", 1: "Commanded Value", 2: "Actual Position of Axis", 7: "Voltage of Output Chan"}
"""Supported record options; the position is in µm, voltages are those at the piezo in V."""


class Recorder:
    """Tables that share one memory. All start together and end when the memory is full.

    Parameters
    ----------
    tables : int
        Number of tables.
    points : int
        Number of samples that all tables together can store.
    command_gain : float
        Open-loop command divided by drive voltage [1/V].
    faults : Faults
        Faults that occur.
    """

    def __init__(self, tables: int, points: int, command_gain: float, faults: Faults) -> None:
        self.numbers, self.points, self.rate = range(1, tables + 1), points, 1
        self._command_gain, self._faults = command_gain, faults
        self._options = dict.fromkeys(self.numbers, 0) | {1: 1, 2: 2}
        self._parts: list[Samples] = []
        self._cycles, self._room = 0, 0

    def configure(self, table: int, option: int) -> None:
        """Record another quantity in a table from now on."""
        self._require_table(table)
        if option not in OPTIONS:
            raise Refusal(NO_RECORD_OPTION)
        self._options[table] = option

    def option(self, table: int) -> int:
        """Record option of a table."""
        self._require_table(table)
        return self._options[table]

    def start(self, expected_cycles: int) -> None:
        """Begin to record; `expected_cycles` is the number of servo cycles of the waveform that is played."""
        self._parts, self._cycles = [], 0
        self._room = self.points // len(self.numbers) * self.rate
        if self._faults.lasts("short_record"):
            self._room = min(self._room, expected_cycles * 4 // 5)

    def take(self, drive: Samples, voltage: Samples, displacement: Samples) -> None:
        """Record servo cycles: drive [V], piezo voltage [V] and displacement [m], each of shape (n,)."""
        count = min(drive.size, self._room - self._cycles)
        if count > 0:
            columns = (drive * self._command_gain, displacement * 1e6, voltage)
            self._parts.append(np.stack([column[:count] for column in columns]))
            self._cycles += count

    @property
    def recorded(self) -> int:
        """Number of samples in every table since the last start."""
        return -(-self._cycles // self.rate)

    def read(self, first: int, count: int, tables: Sequence[int]) -> Samples:
        """Samples of some tables from number `first` on, where 1 is the first sample; shape (count, tables)."""
        if first < 1 or count < 1:
            raise Refusal(OUT_OF_RANGE)
        if first + count - 1 > self.recorded:
            raise Refusal(TOO_FEW_RECORDED)
        if self._faults.lasts("duplicated"):
            first = max(first - count, 1)
        kept = np.concatenate(self._parts, axis=1)[:, :: self.rate]
        if self._faults.lasts("skewed"):
            kept[1] = np.r_[kept[1, :1], kept[1, :-1]]
        rows = {0: np.zeros(kept.shape[1]), 1: kept[0], 2: kept[1], 7: kept[2]}
        columns = [rows[self.option(table)][first - 1 : first - 1 + count] for table in tables]
        return np.stack(columns[::-1] if self._faults.lasts("swapped") else columns, axis=1)

    def _require_table(self, table: int) -> None:
        if table not in self.numbers:
            raise Refusal(NO_RECORDER_TABLE)
