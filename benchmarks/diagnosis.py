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

"""Cost of a diagnosis: seconds of one core and memory, over the number of samples and of effects in the catalogue.

The stage of the naming benchmark with hidden creep; the rich protocol with slowly stored slow phases, as recommended,
and at the full rate of 50 kHz, as a recorder may store it.

    python -m benchmarks.diagnosis --holds 1 5 16
"""

from __future__ import annotations

import argparse
import io
import os
import resource
import time
from collections.abc import Collection
from contextlib import redirect_stdout
from tempfile import TemporaryDirectory

import numpy as np

from benchmarks.figures import Cell, Figures, alone
from benchmarks.independent_plant import NATIVE, Plant
from benchmarks.naming_cases import Case, cases
from benchmarks.naming_experiments import ProtocolVariant, rich
from piezo_hysteresis import recording
from piezo_hysteresis.cli.main import main
from piezo_hysteresis.discrepancy import diagnose
from piezo_hysteresis.effects import CATALOGUE, Creep, Effect
from piezo_hysteresis.record import Experiment

USUAL, LONG, MEMORY = 10.0, 60.0, 4.0
"""Seconds for 150 000 samples, seconds for 8.75 million, GB for these."""
PAIRS = (
    Case("pairs", ("rate_dependent_hysteresis", "mains_hum"), 1, 5e-4),
    Case("pairs", ("softening", "backlash"), 1, 5e-4),
)
"""Stages with two effects, whose diagnoses take longer."""
HALF, NEARLY_ALL = 5.0, 20.0
"""Processor time that half of the diagnoses, and 95 % of them, may take [s]."""


class FullRate:
    """A stage of which every phase is stored at its fastest period."""

    def __init__(self, plant: Plant) -> None:
        self.plant, self.volt = plant, plant.volt

    def play(self, drive, period, phase, rng, start_time=0.0, averaged=1):
        """See `benchmarks.naming_experiments.Player`."""
        finer = round(period / NATIVE)
        drive = np.interp(np.arange(drive.size * finer) / finer, np.arange(drive.size), drive)
        return self.plant.play(drive, NATIVE, phase, rng, start_time)


def stage() -> Plant:
    """A stage with creep."""
    return Plant.random(np.random.default_rng(5), hidden={"creep": ("logarithmic", 0.015)})


def cost(experiment: Experiment, effects: Collection[type[Effect]] = CATALOGUE) -> tuple[float, str]:
    """Processor time of a diagnosis [s], and its answer."""
    begin = time.process_time()
    found = diagnose(experiment, effects=effects, cores=1)
    return time.process_time() - begin, " and ".join(found.names) or str(found.verdict)


def peak() -> float:
    """Largest memory of this process so far [GB]."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6


def exponent(sizes: list[float], costs: list[float]) -> float:
    """Slope of log cost over log size: 1 is linear."""
    return float(np.polyfit(np.log(sizes), np.log(costs), 1)[0]) if len(sizes) > 1 else float("nan")


def arguments(parser: argparse.ArgumentParser) -> None:
    """Options."""
    parser.add_argument("--hidden", type=int, default=20, help="number of simulated stages with a hidden effect")
    parser.add_argument("--holds", type=float, nargs="+", default=[1.0, 5.0, 16.3], help="length of the steps [s]")


def run(options: argparse.Namespace) -> list[Figures]:
    """Usual experiment, experiments at full rate, libraries of several sizes."""
    usual = rich(stage(), 1)
    cost(usual)
    spent, said = cost(usual)
    failures = [] if spent <= USUAL else [f"{usual.size} samples: {spent:.1f} s, expected at most {USUAL:g} s"]
    rows: list[tuple[Cell, ...]] = [("slow phases stored slowly", usual.size, spent, peak(), said)]
    sizes, costs = [], []
    for hold in sorted(options.holds):
        full = rich(FullRate(stage()), 1, ProtocolVariant(hold=hold))
        spent, said = cost(full)
        rows.append((f"all at 50 kHz, {sum(r.duration for r in full):.0f} s", full.size, spent, peak(), said))
        sizes.append(float(full.size))
        costs.append(spent)
    if costs and costs[-1] > LONG:
        failures.append(f"{full.size} samples: {costs[-1]:.1f} s, expected at most {LONG:g} s")
    if peak() > MEMORY:
        failures.append(f"{peak():.1f} GB, expected at most {MEMORY:g} GB")
    samples = Figures(
        f"Diagnosis against samples: cost ∝ samples^{exponent(sizes, costs):.2f} at 50 kHz",
        ("experiment", "samples", "s of one core", "peak memory so far, GB", "answer"),
        rows,
        tuple(failures),
    )
    others = [e for e in CATALOGUE if e is not Creep]
    counts = (3, 6, 12, len(CATALOGUE))
    times = [cost(usual, (Creep, *others[: count - 1])) for count in counts]
    slope = exponent([float(c) for c in counts], [t for t, _ in times])
    library = Figures(
        f"Diagnosis against effects in the library: cost ∝ effects^{slope:.2f}",
        ("effects", "s of one core", "answer"),
        [(count, *outcome) for count, outcome in zip(counts, times, strict=True)],
    )
    return [samples, library, distribution(options.hidden), two_cores()]


def distribution(hidden: int) -> Figures:
    """Processor time for stages with one effect and with none.

    Those of the naming benchmark differ in form from the catalogue, and rest between phases. The simulated stage does
    not: its phases follow each other, and ramp from the safe voltage and back, as those of a driver.
    """
    cost(next(cases(("quick",), 1)).experiment())
    apart = [cost(case.experiment())[0] for case in cases(("quick",), 1)]
    joined = [cost(simulated(seed))[0] for seed in range(1, hidden + 1)]
    rows: list[tuple[Cell, ...]] = []
    failures: list[str] = []
    for phases, times in (("apart", apart), ("one after another", joined)):
        half, most = np.quantile(times, (0.5, 0.95)).tolist() if times else (0.0, 0.0)
        rows.append((phases, len(times), half, most, max(times, default=0.0)))
        failures += [f"{phases}: median {half:.1f} s, expected at most {HALF:g} s"] if half > HALF else []
        failures += [f"{phases}: 95 % within {most:.1f} s, expected {NEARLY_ALL:g} s"] if most > NEARLY_ALL else []
    return Figures(
        "Diagnosis of the protocol rich, s of one core",
        ("phases", "stages", "median", "95 % within", "longest"),
        rows,
        tuple(failures),
    )


def simulated(hidden: int) -> Experiment:
    """What ``piezo simulate --protocol rich --hidden`` records."""
    with TemporaryDirectory() as folder, redirect_stdout(io.StringIO()):
        path = f"{folder}/rich"
        main(["simulate", "--protocol", "rich", "--hidden", str(hidden), "--output", path])
        return recording.read(path)


def two_cores() -> Figures:
    """Time that passes with one and with two cores, in turn, for stages with one effect and with two."""
    single = [case for case in cases(("quick",), 1) if case.truth]
    rows: list[tuple[Cell, ...]] = []
    for hidden, members in (("one effect", single), ("two effects", PAIRS)):
        times = np.array([[elapsed(e, cores) for cores in (1, 2)] for e in (case.experiment() for case in members)])
        one, two = times.sum(axis=0).tolist()
        rows.append((hidden, len(members), one, two, one / two))
    return Figures(
        f"Diagnosis with one and with two cores, of {os.cpu_count()}; other work on them hides the gain",
        ("hidden", "stages", "one core, s", "two cores, s", "ratio"),
        rows,
    )


def elapsed(experiment: Experiment, cores: int) -> float:
    """Time that a diagnosis takes on a clock [s]."""
    begin = time.perf_counter()
    diagnose(experiment, cores=cores)
    return time.perf_counter() - begin


if __name__ == "__main__":
    alone(__name__)
