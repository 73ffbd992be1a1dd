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

"""Recovery benchmark: does identification return the published model from its own data?

Data by Eq. (5) to (7) at 20 µs with the published coefficients, v = V/10, white noise of 0.05 % of the full stroke.
The joint identification is compared with the published three steps alone. In their noise record the influence of
earlier hysteresis decays, and this changes the estimate of G.

    python -m benchmarks.recovery --seeds 100
"""

from __future__ import annotations

import argparse
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass

import numpy as np

from benchmarks import published_plant as plant
from benchmarks.figures import Cell, Figures, alone
from piezo_hysteresis.effects import Arx, PublishedBoucWen
from piezo_hysteresis.identification.fit.fit import fit
from piezo_hysteresis.identification.fit.normal_equations import Nuisance
from piezo_hysteresis.identification.identify import identify
from piezo_hysteresis.identification.protocol import excitation, protocol
from piezo_hysteresis.identification.protocol.drive_limits import DriveLimits
from piezo_hysteresis.model.model import Model
from piezo_hysteresis.record import Experiment, Record

METRE = 1e-5
"""Displacement at normalised output 1."""
NOISE = 5e-4
"""Of the full stroke."""
BAND = np.geomspace(1.0, 2000.0, 60)


@dataclass(frozen=True)
class Recovery:
    """One seed: errors in per cent, degrees and standard errors."""

    delay: int
    parameters: np.ndarray
    """Relative errors of A, β, γ, p1, p2 [%]."""
    deviates: np.ndarray
    """Errors over their standard errors by noise alone, because the form of the model is exact here."""
    gain: float
    """Largest error of |G| from 1 Hz to 2 kHz [%]."""
    phase: float
    """Largest error of arg G there [°]."""
    free_run: float
    """RMS against the noise-free truth of data that were not fitted [% of their range]."""
    published_gain: float
    published_parameters: np.ndarray
    published_free_run: float


def phases(seed: int) -> list[tuple[str, np.ndarray]]:
    """Step, noise, triangle, multisine and validation, all at the full rate."""
    limits = DriveLimits()
    step = next(p.voltage for p in protocol.paper(limits) if p.name == "step")
    bodies = {
        "noise": excitation.noise(limits, 0.012, 10e3, 0.8, centre=0.35, seed=seed),
        "triangle": excitation.triangle(limits, (1.0, 0.5), 1.0),
        "multisine": excitation.multisine(limits, 10.0, 2000.0, 0.2, 4, centre=0.5, seed=seed),
        "validation": excitation.mixture(limits, 0.5, seed),
    }
    return [("step", step), *((name, limits.from_safe_to_safe(body)) for name, body in bodies.items())]


def experiment(seed: int, noise: float = NOISE) -> tuple[Experiment, list[np.ndarray]]:
    """Noisy records of the published plant, every phase from rest, and their noise-free displacement [m]."""
    random = np.random.default_rng(seed)
    records, truths = [], []
    for name, voltage in phases(seed):
        truth = METRE * plant.displacement(voltage)
        measured = truth + noise * plant.STROKE * METRE * random.standard_normal(truth.size)
        records.append(Record(voltage, measured, plant.SAMPLE_PERIOD, name))
        truths.append(truth)
    return Experiment(tuple(records), "published plant"), truths


def shape_error(arx: Arx, scale: float) -> tuple[float, float]:
    """Largest error of |G| [%] and of its phase [°] against the truth, with `scale` setting the gauge."""
    truth = Arx(a=plant.A_Z[1:].tolist(), b=plant.B_Z.tolist(), delay=plant.DELAY)
    ratio = scale * arx.response(BAND, plant.SAMPLE_PERIOD) / truth.response(BAND, plant.SAMPLE_PERIOD)
    return 100.0 * float(np.max(np.abs(np.abs(ratio) - 1.0))), float(np.max(np.abs(np.angle(ratio, deg=True))))


def loop_error(model: Model, scale: float = 1.0) -> np.ndarray:
    """Relative errors of A, β, γ, p1, p2 [%], w counted `scale` times."""
    found = model[PublishedBoucWen.name]
    factors = {"A": scale, "p1": scale, "p2": scale}
    return np.array([100.0 * (found[n] * factors.get(n, 1.0) / t - 1.0) for n, t in plant.LOOP.items()])


def free_run_error(model: Model, record: Record, truth: np.ndarray) -> float:
    """RMS against the truth [% of range], offset apart."""
    return 100.0 * float(np.std(model.simulate(record)[0] - truth) / np.ptp(truth))


def recover(seed: int) -> Recovery:
    """Identify the data of one seed."""
    data, truths = experiment(seed)
    gain = plant.B_Z.sum() / plant.A_Z.sum()
    found = identify(data, voltage_scale=10.0, displacement_scale=METRE, gain=float(gain), hysteresis=PublishedBoucWen)
    errors = loop_error(found.model)
    truth = np.array(list(plant.LOOP.values()))
    level, free = [NOISE * plant.STROKE * METRE] * (len(data) - 1), Nuisance(offset=True)
    by_noise = fit(found.fit.model, data[:-1], found.fit.names, floors=level, nuisance=free, max_iterations=1)
    sigma = np.array([by_noise.standard_errors[f"{PublishedBoucWen.name}.{n}"] for n in plant.LOOP])
    magnitude, angle = shape_error(found.model["arx"], 1.0)
    published = found.published
    ratio = published.dynamics.arx.dc_gain / gain
    return Recovery(
        delay=found.delay.samples,
        parameters=errors,
        deviates=errors / 100.0 * truth / sigma,
        gain=magnitude,
        phase=angle,
        free_run=free_run_error(found.model, data[-1], truths[-1]),
        published_gain=shape_error(published.dynamics.arx, 1.0 / ratio)[0],
        published_parameters=loop_error(published.model, ratio),
        published_free_run=free_run_error(published.model, data[-1], truths[-1]),
    )


def coverage(results: list[Recovery]) -> float:
    """Share of 95 % intervals of the five numbers that contain the true value [%]."""
    return 100.0 * float(np.mean(np.abs(np.concatenate([r.deviates for r in results])) <= 1.96))


def figures(results: list[Recovery]) -> Figures:
    """The benchmark in figures: joint identification beside the plain published steps, and the target."""
    worst = np.max(np.abs([r.parameters for r in results]), axis=0)
    plain = np.max(np.abs([r.published_parameters for r in results]), axis=0)
    exact = sum(r.delay == plant.DELAY for r in results)
    rows: list[tuple[Cell, ...]] = [("delay exact, of all", exact, exact, str(len(results)))]
    rows += [
        (f"{name} off by at most, %", float(a), float(b), "0.5")
        for name, a, b in zip(plant.LOOP, worst, plain, strict=True)
    ]
    gains, published = max(r.gain for r in results), max(r.published_gain for r in results)
    free_runs = max(r.free_run for r in results), max(r.published_free_run for r in results)
    rows += [
        ("coverage of 95 % intervals by noise, %", coverage(results), None, "91 to 98"),
        ("|G| off by at most, %", gains, published, "0.3"),
        ("arg G off by at most, °", max(r.phase for r in results), None, "0.2"),
        ("free run against truth, % of range", *free_runs, "0.02"),
    ]
    return Figures(f"Recovery, {len(results)} seeds", ("", "joint", "three steps", "target"), rows)


def arguments(parser: argparse.ArgumentParser) -> None:
    """Options."""
    parser.add_argument("--seeds", type=int, default=100)
    parser.add_argument("--jobs", type=int, default=1)


def run(options: argparse.Namespace) -> list[Figures]:
    """Run the benchmark."""
    with ProcessPoolExecutor(options.jobs) as pool:
        return [figures(list(pool.map(recover, range(options.seeds))))]


if __name__ == "__main__":
    alone(__name__)
