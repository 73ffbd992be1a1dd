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

"""A measured mirror with three actuators and three displacements: one model for all levels, compared with linear ones.

The first four realisations of every level of fsm-mirror are fitted, the last two are test records. If the folder
contains files of an official test part (``u_100mV_test.npy``, …), these are test records too. Errors are RMS of the
second period in free run from the voltages alone, over the three displacements; one constant is free per record.

    python -m benchmarks mirror

Promised errors: less than 0.087 / 0.131 / 0.169 µm at 100 / 200 / 300 mV. Without the data the benchmark only reports
this.
"""

from __future__ import annotations

import argparse
import os
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from benchmarks.figures import Figures, alone
from piezo_hysteresis.identification.axes_equations import Regression, impulse_responses
from piezo_hysteresis.identification.identify_axes import identify_axes
from piezo_hysteresis.model.axes_model import AxesModel
from piezo_hysteresis.model.axes_samples import columns
from piezo_hysteresis.record import Record

LINEAR_LENGTH = 800
"""Taps of the linear responses: the slowest ringing has ended."""
LEVELS = (100, 200, 300)
"""Of the drives [mV rms]."""
PROMISED = (0.087, 0.131, 0.169)
"""Largest error at every level [µm]."""
FITTED = 4
"""Number of realisations that are fitted; the others are test records."""
PERIOD = 8192
"""Samples in a period of the drives."""
RATE = 6400.0
"""Sample rate [Hz]."""


def read(folder: Path, level: int, part: str = "train") -> list[Record]:
    """Realisations of a level, all periods in one record each; they begin in mid-run."""
    u, y = (np.load(folder / f"{name}_{level}mV_{part}.npy") for name in "uy")
    u, y = (a.reshape(*a.shape[:2], -1, a.shape[3] if a.ndim == 4 else 1) for a in (u, y))
    records = []
    for k in range(u.shape[2]):
        drives, moves = (np.concatenate(list(np.moveaxis(a[:, :, k], 2, 0))) for a in (u, y))
        if u.shape[3] == 1:  # one period: it is played twice, so that the second is a steady state
            drives, moves = np.tile(drives, (2, 1)), np.tile(moves, (2, 1))
        others = {f"voltage_{i + 1}": drives[:, i] for i in range(1, drives.shape[1])}
        others |= {f"displacement_{i + 1}": moves[:, i] for i in range(1, moves.shape[1])}
        name = f"{level}mV_{part}_{k + 1}"
        records.append(Record(drives[:, 0], moves[:, 0], 1 / RATE, name, truncated=True, channels=others))
    return records


def linear(records: Sequence[Record]) -> np.ndarray:
    """Best linear approximation: a full matrix of impulse responses, shape (p, l, m)."""
    measured = [columns(r, "displacement") for r in records]
    return impulse_responses(
        (
            Regression(columns(r, "voltage"), y, LINEAR_LENGTH, 1e-12 / float(y.var()))
            for r, y in zip(records, measured, strict=True)
        ),
        LINEAR_LENGTH,
    )[0]


def convolved(taps: np.ndarray, u: np.ndarray) -> np.ndarray:
    """Displacements (n, p) of impulse responses, the oldest sample first."""
    from scipy.signal import oaconvolve

    parts = oaconvolve(u.T[None], taps[:, ::-1].transpose(0, 2, 1), axes=2)[:, :, : len(u)]
    return parts.sum(axis=1).T


def rms(records: Sequence[Record], predictions: Sequence[np.ndarray]) -> float:
    """Error behind the first period over all displacements [µm], one constant free per record."""
    left = [(columns(r, "displacement") - p)[PERIOD:] for r, p in zip(records, predictions, strict=True)]
    return 1e6 * float(np.sqrt(np.mean([(e - e.mean(axis=0)) ** 2 for e in left])))


def speed(model: AxesModel, u: np.ndarray) -> Figures:
    """Time of the prediction, in blocks of 10 ms as drivers send them."""
    size = round(0.01 * RATE)
    state, begun = model.rest(), time.perf_counter()
    for first in range(0, len(u), size):
        _, state = model.run(u[first : first + size], state)
    share = (time.perf_counter() - begun) / (len(u) * model.sample_period)
    rows = [("blocks of 10 ms", f"{100 * share:.1f} %")]
    return Figures("Prediction of all three axes, time over the time of the stage", ("samples", "share"), rows)


def arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    default = os.environ.get("PIEZO_DATA", "../shared/data")
    parser.add_argument("--data", type=Path, default=Path(default), help="folder that holds fsm-mirror")


def run(options: argparse.Namespace) -> list[Figures]:
    """Fit, predict the test records, and compare."""
    folder = options.data / "fsm-mirror"
    title = "Fine steering mirror, three axes: RMSE on records that were not fitted [µm]"
    if not folder.is_dir():
        print(f"mirror: skipped, no measured data in {folder}; give their folder with --data or PIEZO_DATA")
        return []
    train = {level: read(folder, level) for level in LEVELS}
    fitted = {level: train[level][:FITTED] for level in LEVELS}
    everything = [r for level in LEVELS for r in fitted[level]]
    model = identify_axes(everything)
    of_all = linear(everything)
    of_level = {level: linear(fitted[level]) for level in LEVELS}
    judged = {"left out": {level: train[level][FITTED:] for level in LEVELS}}
    if all((folder / f"{name}_{level}mV_test.npy").is_file() for name in "uy" for level in LEVELS):
        judged["official test"] = {level: read(folder, level, "test") for level in LEVELS}
    rows, failures = [], []
    for part, records in judged.items():
        errors = [rms(rs, [model.run(columns(r, "voltage"), model.rest())[0] for r in rs]) for rs in records.values()]
        linears = {
            "best linear approximation of the level": of_level,
            "best linear approximation of all levels": dict.fromkeys(LEVELS, of_all),
        }
        for name, taps in linears.items():
            of = [rms(rs, [convolved(taps[lv], columns(r, "voltage")) for r in rs]) for lv, rs in records.items()]
            rows.append((part, name, *of))
        rows.append((part, "one model for all levels, with hysteresis", *errors))
        failures += [
            f"{part}, {level} mV: {error:.3f} µm, promised less than {limit} µm"
            for level, error, limit in zip(LEVELS, errors, PROMISED, strict=True)
            if not error < limit
        ]
    rows.append(("", "promised: less than", *PROMISED))
    live = speed(model, columns(everything[0], "voltage"))
    return [live, Figures(title, ("part", "model", *(f"{level} mV" for level in LEVELS)), rows, tuple(failures))]


if __name__ == "__main__":
    alone(__name__)
