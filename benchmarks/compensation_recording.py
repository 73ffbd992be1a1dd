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

"""A measured piezo that was driven through another inverse: the command of our inverse, and its predicted error.

In rows 11152 to 12151 of the record Test of picma-p885, the stage was driven through the authors' inverse. Our model is
identified from the record Model, simulates Test up to that row, and is inverted from this state. The stage is not
available: our error is a prediction, and that of the authors is a measurement.
"""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np

from benchmarks.figures import Figures
from benchmarks.real_recordings import ROWS, read
from piezo_hysteresis.compensation import Inverse, Limits
from piezo_hysteresis.identification.identify import identify
from piezo_hysteresis.record import Experiment

DRIVEN = slice(11151, 12151)
"""Rows that were driven through the authors' inverse."""
DESIRED = 8
"""Column of the wanted displacement, from 0 [µm]."""
COLUMNS = ("quantity", "value")


def recorded(folder: str | None) -> Figures:
    """The table; a note if the data are missing."""
    place = Path(folder or os.environ.get("PIEZO_DATA", "../shared/data"))
    file = place / "picma-p885" / "Test_Vi_Do_Di.dat"
    if not file.exists():
        return Figures(f"PICMA record: {file} is not there", COLUMNS, [("compared", "nothing")])
    model = identify(Experiment((read(place, "Model_Vi_Do.dat", ROWS),), "picma"), memory=True).model
    test = read(place, "Test_Vi_Do_Di.dat")
    wanted = 1e-6 * np.loadtxt(file, usecols=DESIRED)[DRIVEN]
    voltage, measured = test.voltage, test.displacement
    wanted += np.mean(measured[DRIVEN] - wanted)  # the path is written about zero, the sensor reads from its own
    before, state = model.run(voltage[: DRIVEN.start], model.rest(0.0))
    # what the sensor reads beyond the model, by the thousand rows before
    beyond = float(np.mean(measured[DRIVEN.start - 1000 : DRIVEN.start] - before[-1000:]))
    under_theirs, _ = model.run(voltage[DRIVEN], state)
    inverse = Inverse(model, Limits(0.0, 3.6))
    u, _ = inverse.command(wanted - beyond, inverse.resume(state))
    reached, _ = model.run(u, state)
    ours = u[inverse.preview :]
    n = wanted.size
    planned = _rms(reached[inverse.preview :][50:] + beyond - wanted[50:])
    free = measured[DRIVEN] - under_theirs - beyond
    late = _best_lag(wanted, measured[DRIVEN])
    rows = [
        ("range of the path [µm]", 1e6 * float(np.ptp(wanted))),
        ("tracking error measured with the authors' inverse, rms [µm]", 1e6 * _rms(measured[DRIVEN] - wanted)),
        ("free-run error of our model under their drive, rms [µm]", 1e6 * _rms(free)),
        ("error left by our plan, rms [µm]", 1e6 * planned),
        ("error predicted for our drive, rms [µm]", 1e6 * float(np.hypot(planned, _rms(free)))),
        ("the same [% of the range of the path]", 100.0 * float(np.hypot(planned, _rms(free)) / np.ptp(wanted))),
        ("difference of the two drives, rms [V]", _rms(ours - voltage[DRIVEN][:n])),
        ("preview of our inverse [ms]", 1e3 * inverse.preview_time),
        ("lag of what was measured behind the path [rows of 5 ms]", float(late)),
    ]
    return Figures("PICMA record driven through another inverse, off-line", COLUMNS, rows)


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _best_lag(wanted: np.ndarray, measured: np.ndarray) -> int:
    """Shift of the path, in rows, at which it agrees best with the measured one."""
    return min(range(10), key=lambda k: _rms(measured[k:] - wanted[: wanted.size - k]))
