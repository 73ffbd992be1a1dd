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

"""`StageLog`: the voltages that a stage received, from the log of the watched driver."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np

import piezo_hysteresis

STEP = 20.0 / 2**16
"""Step of the converter of the simulated stage [V]. The applied and the reported voltage are rounded to it."""


PIECE = 1 << 22
"""Samples of a log that are looked at together: hours at 100 kHz do not fit into memory."""


class StageLog:
    """A log and the limits that every sample in it must keep.

    Parameters
    ----------
    path : Path
        Of the log.
    sample_period : float
        Time between samples [s].
    voltage_min, voltage_max, max_slew_rate, ramp_rate : float
        Limits of the driver.
    """

    def __init__(
        self,
        path: Path,
        sample_period: float,
        voltage_min: float,
        voltage_max: float,
        max_slew_rate: float,
        ramp_rate: float,
    ) -> None:
        self.path, self._step = path, max_slew_rate * sample_period
        self._low, self._high = voltage_min, voltage_max
        self.environment = {"PYTHONPATH": str(Path(piezo_hysteresis.__file__).parents[1])}
        self.driver = [sys.executable, str(Path(__file__).with_name("watched_driver.py")), str(path)]

    @property
    def voltages(self) -> np.ndarray:
        """Everything that the stage was given [V]; NaN where a driver began."""
        data = self.path.read_bytes()
        return np.frombuffer(data[: len(data) // 8 * 8])

    def pieces(self) -> Iterator[np.ndarray]:
        """The log in order; each piece but the first begins with the last sample of the one before it."""
        size, begin = self.path.stat().st_size // 8, 0
        while begin + 1 < size or begin == 0:
            yield np.fromfile(self.path, count=min(PIECE, size - begin), offset=8 * begin)
            begin += PIECE - 1

    @property
    def given(self) -> int:
        """Voltages that the stage was given."""
        return self.path.stat().st_size // 8 - self.starts

    @property
    def starts(self) -> int:
        """Drivers that were started."""
        return sum(int(np.isnan(piece[bool(k) :]).sum()) for k, piece in enumerate(self.pieces()))

    def shift_clock(self, offset: float) -> None:
        """Let the clock of the computer be off by so much [s], as drivers see it."""
        draft = self.path.with_name("clock.tmp")
        draft.write_text(str(offset))
        draft.replace(f"{self.path}.clock")

    def check(self) -> None:
        """Every sample is inside the limits, and no steeper than allowed, from the safe voltage of every start on."""
        assert self.given > 100
        for voltages in self.pieces():
            begins = np.isnan(voltages)
            inside = voltages[~begins]
            assert ((self._low <= inside) & (inside <= self._high)).all(), f"{inside.min():g} to {inside.max():g} V"
            step = np.abs(np.diff(np.where(begins, 0.0, voltages)))
            step[begins[1:]] = 0.0
            assert (step <= self._step * (1 + 1e-9) + STEP).all(), f"{step.max():g} V in one sample"
