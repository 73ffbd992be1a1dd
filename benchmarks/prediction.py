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

"""How well `piezo identify` predicts drives that were not fitted, on stages of another form than its models.

Three experiments with stages of `benchmarks.other_forms` are fitted, and five other drives are predicted in free run. A
converter of 14 bits reads the displacement. Every stage was driven up and back before each record, which no record
shows. The rival is what a laboratory fits in an afternoon: ten plays and a linear part by least squares, before one
mode and a delay; it is told what was driven before. Errors are RMS in % of the range of the triangles, one constant
free per record; all means are geometric.

With ``--diagnosed``, `piezo diagnose` searches seven records of every stage, and the model that it saves predicts.

    python -m benchmarks.prediction --stages 2
    python -m benchmarks.prediction --stages 2 --diagnosed
    python -m benchmarks.prediction --quick
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence

import numpy as np
from scipy import signal
from scipy.optimize import least_squares

from benchmarks import independent_kernels as kernels
from benchmarks.figures import Cell, Figures, alone
from benchmarks.naming_experiments import ladder
from benchmarks.nanopositioner import Nanopositioner
from benchmarks.other_forms import KINDS, random_stage
from benchmarks.real_recordings import Prediction, free_run
from piezo_hysteresis.discrepancy.diagnose import diagnose
from piezo_hysteresis.identification.identify import identify
from piezo_hysteresis.record import Experiment, Record

PERIOD = 5e-4
"""Sample period [s]."""
VOLT = 10.0
"""Top of the drive, from 0 [V]."""
BITS = 14
"""Of the converter, whose range is twice the stroke."""
METRE = 1e-5
"""Scale of the displacement in the rival's fit [m]."""
BEFORE = ladder((0.0, 1.0, 0.0), 0.5, 2.0, PERIOD)
"""What is driven before every record, as a share of the top."""
EXPERIMENTS = {
    "triangles + steps": ("triangle", "step"),
    "triangles + noise": ("triangle", "noise"),
    "all three": ("triangle", "step", "noise"),
}
"""Experiment to the phases that are fitted."""
MODELS = ("published (--no-memory)", "`piezo identify`", "rival: plays, mode, delay")
RADII = np.linspace(0.0, 0.9, 11)
"""Of the rival's plays as a share of the top; 0 is the linear part."""
STARTS = (50.0, 150.0, 500.0)
"""Frequencies from which the rival's mode is searched [Hz]."""
BOUNDS = ((np.log(10.0), np.log(1e-3), 0.0), (np.log(900.0), np.log(10.0), 20.0))
"""Least and largest logarithm of the rival's mode [Hz] and of its damping, and delay in samples."""

Array = np.ndarray


def measured(stage: Nanopositioner, phase: str, drive: Array) -> Record:
    """Record of a drive, given as a share of the top."""
    y = stage.play(VOLT * np.concatenate((BEFORE, drive)), PERIOD).displacement[BEFORE.size :]
    step = 2.0 * stage.stroke / 2**BITS
    return Record(VOLT * drive, step * np.round(y / step), PERIOD, phase)


def fitted_drives() -> dict[str, Array]:
    """Phases of the experiments, as shares of the top."""
    loops = ((1.0, 2, 1.0), (0.6, 2, 1.0), (0.3, 2, 1.0), (1.0, 8, 10.0))  # top, number, frequency [Hz]
    triangles = [ladder((0.0, *(top, 0.0) * count), 0.0, 2.0 * top * f, PERIOD) for top, count, f in loops]
    low_pass = signal.butter(4, 150.0, fs=1.0 / PERIOD, output="sos")
    return {
        "triangle": np.concatenate((np.zeros(400), *triangles)),
        "step": np.repeat((0.0, 0.3, 0.8, 0.0, 1.0, 0.0), 1200),
        "noise": around_the_middle(signal.sosfiltfilt(low_pass, np.random.default_rng(1).normal(size=6000))),
    }


def other_drives() -> dict[str, Array]:
    """Drives that are set aside, as shares of the top."""
    t, rng = PERIOD * np.arange(6000), np.random.default_rng(2)
    sines = [top * (0.5 - 0.5 * np.cos(2.0 * np.pi * 20.0 * t[:600])) for top in (0.5, 0.9)]
    small = (ladder((0.0, 0.5), 0.1, 1.0, PERIOD), 0.5 + 0.2 * np.sin(2.0 * np.pi * 8.0 * t[:2000]))
    phases = 2.0 * np.pi * (np.outer((1.0, 2.3, 4.1, 7.7, 12.5), t) + rng.uniform(size=(5, 1)))
    return {
        "minor loops": ladder((0.0, 0.7, 0.5, 0.65, 0.2, 0.4, 0.0), 0.05, 1.0, PERIOD),
        "sine, 20 Hz": np.concatenate((np.zeros(400), *sines)),
        "small sine, 8 Hz": np.concatenate(small),
        "random staircase": np.repeat(np.append(0.0, rng.uniform(0.05, 0.95, 12)), 400),
        "multisine, 1 to 12.5 Hz": around_the_middle(np.sin(phases).sum(axis=0)),
    }


def around_the_middle(wave: Array) -> Array:
    """From rest at 0 to the middle, then the wave, faded in and out, over the whole range."""
    wave = wave * signal.windows.tukey(wave.size, 0.1)
    return np.concatenate((ladder((0.0, 0.5), 0.2, 2.0, PERIOD), 0.5 + 0.5 * wave / np.abs(wave).max()))


def diagnosed_drives() -> dict[str, Array]:
    """Phases of the experiment of a diagnosis, as shares of the top."""
    loops = {"triangle_1": (1.0, 2, 1.0), "triangle_2": (0.6, 2, 1.0), "triangle_3": (1.0, 6, 5.0)}
    return {
        **{name: ladder((0.0, *(top, 0.0) * n), 0.0, 2.0 * top * f, PERIOD) for name, (top, n, f) in loops.items()},
        "sine_5hz": 0.4 - 0.4 * np.cos(2.0 * np.pi * 5.0 * PERIOD * np.arange(4000)),
        "minor_loops": ladder((0.0, 0.9, 0.3, 0.8, 0.1, 0.5, 0.2, 0.0), 0.02, 1.5, PERIOD),
        **{name: fitted_drives()[name] for name in ("step", "noise")},
    }


def rival(records: Sequence[Record]) -> Prediction:
    """Plays by linear least squares, behind the best mode, damping and delay."""

    def plays(record: Record) -> Array:
        drive = np.concatenate((BEFORE, record.voltage / VOLT))
        return np.array([kernels.plays(drive, 0.0, np.array([r]), np.ones(1)) for r in RADII])

    def moved(held: Array, shape: Array) -> Array:
        omega, zeta, (whole, part) = 2.0 * np.pi * np.exp(shape[0]), np.exp(shape[1]), divmod(shape[2], 1.0)
        late = np.pad(held, ((0, 0), (int(whole) + 1, 0)))[:, : held.shape[1] + 1]
        mode = signal.bilinear([omega**2], [1.0, 2.0 * zeta * omega, omega**2], 1.0 / PERIOD)
        y = signal.lfilter(*mode, (1.0 - part) * late[:, 1:] + part * late[:, :-1])[:, BEFORE.size :]
        return np.asarray(y - y.mean(axis=1, keepdims=True))

    wanted = np.concatenate([r.displacement - r.displacement.mean() for r in records]) / METRE
    held = [plays(r) for r in records]

    def misfit(shape: Array) -> Array:
        x = np.hstack([moved(h, shape) for h in held])
        return np.linalg.lstsq(x.T, wanted, rcond=1e-8)[0] @ x - wanted

    trials = [least_squares(misfit, (np.log(f), np.log(0.1), 1.0), diff_step=1e-3, bounds=BOUNDS) for f in STARTS]
    best = min(trials, key=lambda trial: float(trial.cost)).x
    weights = np.linalg.lstsq(np.hstack([moved(h, best) for h in held]).T, wanted, rcond=1e-8)[0]
    return lambda record: np.asarray(METRE * weights @ moved(plays(record), best))


def errors(stage: Nanopositioner, phases: Sequence[str], records: Mapping[str, Record]) -> tuple[Array, float, float]:
    """Error of every model on every drive set aside (models, drives), the error that `identify` states, and the noise.

    All in % of the range of the triangles.
    """
    fitted = Experiment(tuple(records[phase] for phase in phases))
    found = identify(fitted, memory=True)
    predictions = (free_run(identify(fitted).model), free_run(found.model), rival(fitted.records))
    percent = 100.0 / np.ptp(fitted[0].displacement)
    left = [[percent * np.std(records[n].displacement - p(records[n])) for n in other_drives()] for p in predictions]
    noise = percent * stage.stroke * np.hypot(stage.noise, 2.0 / 2**BITS / np.sqrt(12.0))
    return np.array(left), float(percent * found.free_run_error), float(noise)


def diagnosed(kinds: Sequence[str], stages: int) -> Figures:
    """What is named of every stage, and the errors of the published and the saved model on the drives set aside."""
    rows: list[tuple[Cell, ...]] = []
    for kind in kinds:
        for seed in range(stages):
            stage = random_stage(KINDS[kind], seed)
            used, others = ([measured(stage, *d) for d in f().items()] for f in (diagnosed_drives, other_drives))
            found, percent = diagnose(Experiment(tuple(used))), 100.0 / np.ptp(used[0].displacement)
            models = [free_run(m) for m in (found.baseline, found.model) if m is not None]
            left = [[percent * float(np.std(r.displacement - p(r))) for r in others] for p in models]
            rows.append(
                (kind, seed, str(found.verdict), ", ".join(found.names), *mean(np.array(left), 1), max(left[1]))
            )
    columns = ("stage", "seed", "verdict", "named", "published model", "saved model", "saved model, largest")
    return Figures("RMS error on drives that were not fitted, % of range", columns, rows)


def mean(values: Array, axis: int | tuple[int, ...]) -> list[float]:
    """Geometric means."""
    return np.exp(np.log(values).mean(axis=axis)).tolist()


def arguments(parser: argparse.ArgumentParser) -> None:
    """Number of stages."""
    parser.add_argument("--stages", type=int, default=2, help="of every kind")
    parser.add_argument("--diagnosed", action="store_true", help="the model that `piezo diagnose` saves")
    parser.add_argument("--quick", action="store_true", help="one stage of relays, triangles and noise")


def run(options: argparse.Namespace) -> list[Figures]:
    """One row per kind of stage and experiment, then one row per drive."""
    kinds = ["relays"] if options.quick else list(KINDS)
    if options.diagnosed:
        return [diagnosed(kinds, 1 if options.quick else options.stages)]
    names = ["triangles + noise"] if options.quick else list(EXPERIMENTS)
    drives = {**fitted_drives(), **other_drives()}
    found: dict[tuple[str, str], list[tuple[Array, float, float]]] = {(k, n): [] for k in kinds for n in names}
    for seed in range(1 if options.quick else options.stages):
        for kind in kinds:
            stage = random_stage(KINDS[kind], seed)
            records = {phase: measured(stage, phase, drive) for phase, drive in drives.items()}
            for name in names:
                found[kind, name].append(errors(stage, EXPERIMENTS[name], records))
    left = {key: np.array([one[0] for one in group]) for key, group in found.items()}
    rows: list[tuple[Cell, ...]] = [
        (*key, *mean(left[key], (0, 2)), *mean(np.array([one[1:] for one in group]), 0)) for key, group in found.items()
    ]
    total = np.concatenate(list(left.values()))
    by_drive: list[tuple[Cell, ...]] = [
        (name, *mean(total[:, :, k], 0), float(total[:, 1, k].max())) for k, name in enumerate(other_drives())
    ]
    by_drive.append(("all", *mean(total, (0, 2)), float(total[:, 1].max())))
    title = "RMS error on drives that were not fitted, % of range"
    return [
        Figures(title, ("stage", "experiment", *MODELS, "error that `identify` states", "noise"), rows),
        Figures(title, ("drive", *MODELS, "`piezo identify`, largest"), by_drive),
    ]


if __name__ == "__main__":
    alone(__name__)
