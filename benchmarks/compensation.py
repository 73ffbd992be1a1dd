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

"""Tracking error of a stage that is driven through the inverse of its model.

The simulated stages of the package are independent of the models. Each is identified and diagnosed from a recording
with 0.05 % of noise; then the same paths are driven with every method. The stage is at rest at 0 V before each path.
The score is the rms error on the path in % of its range, read without noise through the 16-bit converters; learning
measures with the noise. The first and the last 3 ms of a path, where it starts and stops with a kink, are not scored.

    python -m benchmarks.compensation --stages published creeping
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass

import numpy as np

from benchmarks.compensation_feedback import PERIOD, best_feedback
from benchmarks.compensation_recording import recorded
from benchmarks.compensation_rivals import hysteresis_alone, linear_gain, multiplicative
from benchmarks.compensation_speed import blocks as block_latency
from benchmarks.compensation_speed import speed
from benchmarks.figures import Cell, Figures, alone
from benchmarks.naming_experiments import PackagedPlant, rich
from piezo_hysteresis.compensation import IterativeLearning, Limits, Plan, learn, plan
from piezo_hysteresis.discrepancy import diagnose
from piezo_hysteresis.identification.free_run_error import errors
from piezo_hysteresis.stage.plant import PlantParameters
from piezo_hysteresis.stage.simulated import SimulatedStage

LIMITS = Limits(0.0, 10.0)
"""Of the drive."""
LOW, HIGH = 0.12, 0.82
"""Ends of the paths, as shares of the stroke at 10 V: 70 % of it."""
STAGES = {
    "published": PlantParameters(),
    "creeping": PlantParameters().with_values({"creep.gamma": 0.0143}),
    "plays, creeping": PlantParameters.from_mapping(
        {"hysteresis.operator": "prandtl_ishlinskii", "creep.gamma": 0.0143}
    ),
    "resonance": PlantParameters().with_values(
        {
            "structure.resonance_share": 0.1,
            "structure.resonance_frequency": 1200.0,
            "structure.resonance_damping": 0.01,
        }
    ),
}
"""Stage to its physics: the paper's; with hidden creep; Prandtl-Ishlinskii with hidden creep; a mode at 1.2 kHz."""
PATHS = (
    ("sine", 1.0),
    ("sine", 10.0),
    ("sine", 50.0),
    ("sine", 100.0),
    ("sine", 200.0),
    ("sine", 400.0),
    ("triangle", 10.0),
    ("triangle", 50.0),
    ("triangle", 100.0),
)
EDGE = round(3e-3 / PERIOD)
"""Samples at both ends of a path that are not scored."""


@dataclass(frozen=True)
class Promise:
    """Largest errors of the diagnosed model before, and after learning, in % of range."""

    sines: float = 0.05
    fast_sine: float = 0.1
    triangles: float = 0.1
    learned: float | None = None

    def of(self, shape: str, frequency: float) -> float:
        """Before learning."""
        return self.triangles if shape == "triangle" else self.sines if frequency <= 100.0 else self.fast_sine


PROMISED = {
    "published": Promise(),
    "creeping": Promise(),
    "plays, creeping": Promise(learned=0.06),
    "resonance": Promise(),
}


def path(shape: str, frequency: float, stroke: float) -> np.ndarray:
    """A path [m]: a third of a second, at least two and a half periods, from the middle of the range."""
    count = round(max(2.5, min(10.0, 0.3 * frequency)) / frequency / PERIOD)
    phase = np.arange(count) * PERIOD * frequency
    if shape == "sine":
        wave = 0.5 + 0.5 * np.sin(2.0 * np.pi * phase)
    else:
        wave = 0.5 + 0.5 * (1.0 - np.abs(4.0 * ((phase + 0.25) % 1.0) - 2.0))
    return stroke * (LOW + (HIGH - LOW) * wave)


class Bench:
    """A stage, its models, and the measurements on it.

    Parameters
    ----------
    parameters : PlantParameters
        Physics.
    seed : int
        Of experiment and noise.
    """

    def __init__(self, parameters: PlantParameters, seed: int) -> None:
        self.noisy = parameters
        self.parameters = parameters.with_values({"sensor.noise": 0.0})
        self.stroke = self._settled(10.0) - self._settled(0.0)
        self.seed = seed
        self._free_run: float | None = None
        self.diagnosis = diagnose(rich(PackagedPlant(parameters, seed), seed))

    def _settled(self, voltage: float) -> float:
        return float(self.play(np.full(3000, voltage))[-1])

    def free_run_percent(self, span: float) -> float:
        """Error of the diagnosed model in free run on noise-free records of another seed [% of `span`]."""
        if self._free_run is None:
            held_out = rich(PackagedPlant(self.parameters, self.seed + 1), self.seed + 1)
            self._free_run = errors(self.diagnosis.model, held_out).rms
        return 100.0 * self._free_run / span

    def play(self, voltage: np.ndarray, seed: int | None = None) -> np.ndarray:
        """Displacement from rest at 0 V [m]; with the noise of the sensor where a seed is given."""
        stage = SimulatedStage(self.parameters if seed is None else self.noisy, seed=seed or 0)
        return stage.play(np.clip(voltage, 0.0, 10.0), initial_voltage=0.0).displacement

    def percent(self, found: Plan, voltage: np.ndarray) -> float:
        """Error on the path [% of its range]."""
        return score(self.play(voltage)[found.begin : found.begin + found.wanted.size], found.wanted)


def score(reached: np.ndarray, wanted: np.ndarray) -> float:
    """Rms error on a path [% of its range]."""
    off = (reached - wanted)[EDGE:-EDGE]
    return 100.0 * float(np.sqrt(np.mean(off**2)) / np.ptp(wanted))


def wanted_with_way(found: Plan) -> np.ndarray:
    """The path with its way from rest and the time of the preview, as every method gets it."""
    begin = found.begin
    way = found.wanted[0] * (0.5 - 0.5 * np.cos(np.pi * np.arange(begin) / begin))
    return np.concatenate((way, found.wanted))


def rows_of(bench: Bench, with_feedback: bool) -> list[tuple[Cell, ...]]:
    """Every path on one stage."""
    base, extended = bench.diagnosis.baseline, bench.diagnosis.model
    assert base is not None and extended is not None
    rows: list[tuple[Cell, ...]] = []
    for shape, frequency in PATHS:
        wanted = path(shape, frequency, bench.stroke)
        found = plan(extended, wanted, LIMITS)
        led = wanted_with_way(found)

        def simple(voltage: np.ndarray, found: Plan = found) -> float:
            return bench.percent(found, voltage)

        rivals = [simple(linear_gain(led, bench.stroke, 10.0)), simple(hysteresis_alone(extended, led, LIMITS))]
        rivals.append(simple(multiplicative(base, led, LIMITS)) if "bouc_wen" in base else float("nan"))
        closed: float | None = None
        if with_feedback:
            part = slice(found.begin + EDGE, led.size - EDGE)
            rms, _ = best_feedback(bench.parameters, led, part, 10.0 / bench.stroke, LIMITS)
            closed = 100.0 * rms / found.range
        identified = plan(base, wanted, LIMITS)
        noise = bench.noisy.sensor.noise * bench.noisy.full_stroke
        learning = IterativeLearning(extended, found, LIMITS, noise=noise)
        learn(learning, lambda u: bench.play(u, seed=17 + bench.seed), rounds=2)
        rows.append(
            (
                f"{shape} {frequency:g} Hz",
                *rivals,
                closed,
                bench.percent(identified, identified.voltage),
                bench.percent(found, found.voltage),
                float(np.hypot(score(found.path_predicted, wanted), bench.free_run_percent(found.range))),
                _learned(bench, learning),
            )
        )
    return rows


def _learned(bench: Bench, learning: IterativeLearning) -> float:
    """Error of the last drive that was played [% of range]."""
    last = learning.rounds[-1].plan
    return score(bench.play(last.voltage)[last.begin : last.begin + learning.wanted.size], learning.wanted)


COLUMNS = (
    "path",
    "linear gain",
    "hysteresis inverse alone",
    "multiplicative inverse",
    "PI feedback, best gains",
    "identified model",
    "diagnosed model",
    "expected with it",
    "after two rounds",
)


def tracking(name: str, seed: int, with_feedback: bool) -> Figures:
    """The table of one stage."""
    bench = Bench(STAGES[name], seed)
    rows = rows_of(bench, with_feedback)
    failures = []
    promise = PROMISED.get(name)
    for row, (shape, frequency) in zip(rows, PATHS, strict=True):
        if promise is None:
            break
        limit = promise.of(shape, frequency)
        if not row[6] <= limit:  # type: ignore[operator]
            failures.append(f"{row[0]}: {row[6]:.3f} %, promised {limit:g} %")
        if promise.learned is not None and not row[8] <= promise.learned:  # type: ignore[operator]
            failures.append(f"{row[0]} after two rounds: {row[8]:.3f} %, promised {promise.learned:g} %")
    added = ", ".join(e.name for e in bench.diagnosis.model.effects)
    title = f"Stage '{name}': rms error in % of the range of the path; diagnosed chain: {added}"
    return Figures(title, COLUMNS, rows, tuple(failures))


def arguments(parser: argparse.ArgumentParser) -> None:
    """Options."""
    parser.add_argument("--stages", nargs="+", choices=STAGES, default=list(STAGES))
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--no-feedback", action="store_true", help="without the search for PI gains")
    parser.add_argument("--data", default=None, help="folder of measured data (default: PIEZO_DATA or ../shared/data)")
    parser.add_argument("--samples", type=int, default=200_000, help="of the speed test")


def run(options: argparse.Namespace) -> list[Figures]:
    """A table for every stage, the measured record, and speed."""
    tables = [tracking(name, options.seed, not options.no_feedback) for name in options.stages]
    return [*tables, recorded(options.data), speed(options.samples), block_latency()]


if __name__ == "__main__":
    alone(__name__)
