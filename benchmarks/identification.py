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

"""Identification of a million samples, and the joint fit compared with scipy's least squares and finite differences.

Both fits have the same start values, free parameters and kernels, and stop at the same relative decrease of the cost.
Our fit keeps G(1) constant, because it is not determined; scipy keeps this redundant direction. Times are processor
times.

    python -m benchmarks.identification --seeds 4
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence

import numpy as np
from scipy.optimize import least_squares

from benchmarks import published_plant as plant
from benchmarks import recovery
from benchmarks.figures import Figures, alone
from benchmarks.narmax import against_sysidentpy
from piezo_hysteresis.effects import Arx, PublishedBoucWen
from piezo_hysteresis.errors import PiezoError
from piezo_hysteresis.identification import fit, identify, three_steps
from piezo_hysteresis.identification.steps.dynamics import identify_arx
from piezo_hysteresis.identification.steps.linear_start import hysteresis_signals
from piezo_hysteresis.model.model import Model
from piezo_hysteresis.record import Experiment, Record

TOLERANCE = 1e-6
"""Relative decrease of the cost at which both fits stop."""
SCALES = {"voltage_scale": 10.0, "displacement_scale": recovery.METRE}
LOOP = tuple(f"{PublishedBoucWen.name}.{n}" for n in plant.LOOP)


def experiment(seeds: int) -> Experiment:
    """Records of the published plant, noise and waveforms of so many seeds."""
    return Experiment(tuple(r for seed in range(seeds) for r in recovery.experiment(seed)[0].records), "plant")


def whole(data: Experiment) -> Figures:
    """The published three steps, and `identify`."""
    samples, rows = sum(r.size for r in data.records), []
    gain = float(plant.B_Z.sum() / plant.A_Z.sum())
    options = {**SCALES, "hysteresis": PublishedBoucWen}
    works = {
        "three steps as published": lambda: three_steps(data.records, **options).model,
        "identify: three steps, orders compared, joint fit": lambda: identify(data, gain=gain, **options).model,
    }
    identify(recovery.experiment(0)[0], gain=gain, **options)  # loads the kernels
    for name, work in works.items():
        start = time.process_time()
        model = work()
        spent = time.process_time() - start
        rows.append((name, spent, samples / spent / 1e6, error(model, data)))
    columns = ("what", "processor s", "M samples/s", "free run, held out, % of range")
    return Figures(f"Identification, {samples:.2e} samples in {len(data.records)} records", columns, rows)


def error(model: Model, data: Experiment) -> float:
    """Free-run RMS of the last validation record, without its offset, with its noise [% of its range]."""
    record = data.records[-1]
    return 100.0 * float(np.std(record.displacement - model.simulate(record)[0]) / np.ptp(record.displacement))


def against_scipy(data: Experiment, limit: int) -> Figures:
    """The joint fit, ours and scipy's."""
    records = [r for r in data.records[:5] if r.phase in ("noise", "triangle", "multisine")]
    model, free = start(records)
    begin = time.process_time()
    own = fit(model, records, free, tolerance=TOLERANCE)
    own_time = time.process_time() - begin
    begin = time.process_time()
    found, steps, evaluations, converged = scipy_fit(model, records, free, limit)
    peer_time = time.process_time() - begin
    rows = [
        (
            "analytic sensitivities, normal equations",
            own_time,
            own.iterations,
            rms(own.model, records) * 1e9,
            state(own.converged),
        ),
        ("scipy least_squares, finite differences", peer_time, steps, rms(found, records) * 1e9, state(converged)),
        ("ratio", peer_time / own_time, None, None, f"{evaluations} simulations by scipy"),
    ]
    samples = sum(r.size for r in records)
    columns = ("joint fit", "processor s", "linearisations", "RMS residual, nm", "converged")
    return Figures(f"Joint fit of {len(free)} numbers, {samples:.1e} samples", columns, rows)


def start(records: Sequence[Record]) -> tuple[Model, list[str]]:
    """A loop off by a few per cent, ARX fitted behind it, and the numbers to fit: all but the delay."""
    off = dict(zip(plant.LOOP, (1.05, 0.95, 1.1, 0.9, 1.02), strict=True))
    loop = PublishedBoucWen(**{name: factor * plant.LOOP[name] for name, factor in off.items()})
    gain = float(plant.B_Z.sum() / plant.A_Z.sum())
    frame = Model((loop, Arx(a=(), b=(gain,), delay=plant.DELAY)), plant.SAMPLE_PERIOD, *SCALES.values())
    signals = hysteresis_signals(frame, records, range(len(records)))
    model = frame.with_effect(identify_arx(signals, plant.DELAY, plant.SAMPLE_PERIOD, (8, 8)).arx)
    return model, [*LOOP, *(f"arx.{n}" for n in model["arx"].free_names() if n != "delay")]


def scipy_fit(model: Model, records: Sequence[Record], free: Sequence[str], limit: int) -> tuple[Model, int, int, bool]:
    """Model, linearisations, simulations, and whether it converged within `limit` steps."""
    values = model.values()
    theta = np.array([values[n] for n in free])
    measured = np.concatenate([r.displacement / np.sqrt(r.size) for r in records]) / recovery.METRE
    evaluations = 0

    def misfit(numbers: np.ndarray) -> np.ndarray:
        nonlocal evaluations
        evaluations += 1
        try:
            outputs = model.with_values(dict(zip(free, numbers.tolist(), strict=True))).simulate(records)
        except PiezoError:  # unstable, or |γ| above β: no model
            return np.full(measured.size, 1.0)
        weighted = [y / np.sqrt(r.size) for y, r in zip(outputs, records, strict=True)]
        return measured - np.concatenate(weighted) / recovery.METRE

    found = least_squares(misfit, theta, x_scale="jac", ftol=TOLERANCE, xtol=None, gtol=None, max_nfev=limit)
    best = model.with_values(dict(zip(free, found.x.tolist(), strict=True)))
    return best, int(found.njev), evaluations, found.status > 0


def rms(model: Model, records: Sequence[Record]) -> float:
    """Root of the cost that both minimise: the mean over the records of the mean square residual [m]."""
    left = [r.displacement - y for r, y in zip(records, model.simulate(records), strict=True)]
    return float(np.sqrt(np.mean([np.mean(e**2) for e in left])))


def state(converged: bool) -> str:
    """In words."""
    return "yes" if converged else "no, stopped"


def arguments(parser: argparse.ArgumentParser) -> None:
    """Options."""
    parser.add_argument("--seeds", type=int, default=4, help="260 000 samples each")
    parser.add_argument("--limit", type=int, default=60, help="largest number of steps of scipy")


def run(options: argparse.Namespace) -> list[Figures]:
    """All tables."""
    data = experiment(options.seeds)
    tables = [whole(data), against_scipy(data, options.limit), against_sysidentpy(experiment(1))]
    return [table for table in tables if table is not None]


if __name__ == "__main__":
    alone(__name__)
