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

"""`Minute`: the last samples of a stream, and the scores of any model on them."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..model.chain import Chain, ChainState, ChainTangent
from ..model.model import Model
from ..online.change.score import ChangeScore, Scores, loop_heights
from ..online.voltage_history import DriveHistory

Array = NDArray[np.float64]

_PIECE = 8192
"""Number of samples that are processed together."""


@dataclass(frozen=True, eq=False, slots=True)
class Minute:
    """The last samples of a stream, and the drive before them.

    Parameters
    ----------
    drive : DriveHistory
        Drive up to the newest sample.
    displacement : (k,) ndarray
        Displacement measured in the last k samples of the drive [m].
    offset : float
        Present offset, sensor minus model [m].
    """

    drive: DriveHistory
    displacement: Array
    offset: float

    def save(self, path: Path) -> None:
        """Write the samples to an NPZ file."""
        drive = self.drive
        np.savez(
            path,
            past=np.array([drive.rest_voltage, drive.start_time, drive.slow_period, drive.sample_period]),
            slow=drive.slow,
            full=drive.full,
            holds=np.reshape(drive.holds, (-1, 2)),
            displacement=self.displacement,
            offset=self.offset,
        )

    @classmethod
    def load(cls, path: Path) -> Minute:
        """Samples of a file that `save` has written."""
        with np.load(path, allow_pickle=False) as file:
            rest, start, slow_period, period = map(float, file["past"])
            holds = tuple((int(values), float(duration)) for values, duration in file["holds"])
            drive = DriveHistory(rest, start, slow_period, period, file["slow"], file["full"], holds)
            return cls(drive, file["displacement"], float(file["offset"]))

    def scores(self, model: Model, offset: float) -> list[ChangeScore]:
        """Scores of the samples with a model, where sensor minus model is `offset` [m].

        Samples before the stage leaves its rest are not used.
        """
        drive, loop = self.drive, loop_heights(model)
        displacement = self.displacement[max(0, self.displacement.size - drive.full.size) :]
        first = drive.full.size - displacement.size
        chain, state, tangent = _state_before(model, drive, first, loop)
        scores, counted = Scores(chain, state, loop, tangent), list[ChangeScore]()
        for start in range(0, displacement.size, _PIECE):
            voltage = np.ascontiguousarray(drive.full[first + start : first + start + _PIECE])
            y, state = chain.run(voltage, state)
            counted += scores.add(voltage, displacement[start : start + _PIECE] - y - offset, 0)
        return counted


def _state_before(
    model: Model, drive: DriveHistory, first: int, loop: dict[str, float]
) -> tuple[Chain, ChainState, ChainTangent]:
    """Chain, state and sensitivities of a model before sample `first` of the part of the drive stored in full."""
    fast = model.at(drive.sample_period)
    chain = model.at(drive.slow_period) if drive.slow.size else fast
    state = chain.rest(drive.rest_voltage, drive.start_time, since=0.0)
    tangent = chain.rest_tangent(drive.rest_voltage, loop, drive.start_time)
    for period, voltage in (*drive.until(first), (drive.sample_period, np.empty(0))):
        running = model.at(period)
        if running is not chain:
            state, tangent, chain = running.resume(state), running.resume_tangent(state, tangent), running
        for start in range(0, voltage.size, _PIECE):
            part = np.ascontiguousarray(voltage[start : start + _PIECE])
            _, _, _, state, tangent = running.linearise(part, state, tangent, loop)
    return fast, state, tangent
