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

"""Growth of the cost with samples, effects, fitted parameters, phases and axes: exponents fitted on log axes.

An exponent of 1 means proportional, 0 means no influence. Processor time of one core; the figure has log axes.

    python -m benchmarks.growth --figure growth.svg
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from benchmarks.figures import Figures, alone, seconds
from benchmarks.simulation import ARX, PERIOD, record
from piezo_hysteresis.effects import BY_NAME, BoucWen, Effect
from piezo_hysteresis.identification import fit
from piezo_hysteresis.model.model import Model
from piezo_hysteresis.online.predictor import Predictor
from piezo_hysteresis.record import Record

BLOCK = 500
"""Samples of a block of the stream."""
ADDED = (
    "amplifier_bandwidth",
    "creep",
    "even_input_polynomial",
    "extra_delay",
    "gain_drift",
    "mains_hum",
    "thermal_drift",
)
Work = Callable[[], object]
Case = tuple[str, str, Sequence[int], Callable[[int], Work]]


def switched_on(name: str) -> Effect:
    """An effect of the catalogue with a typical size."""
    kind = BY_NAME[name]
    on = {p.name: p.off + p.scale for p in kind.parameters if p.off is not None and not p.is_array}
    return kind(**on)


def simulate(samples: int) -> Work:
    """One model, records of so many samples."""
    model, data = Model((BoucWen(), ARX), PERIOD), record(samples)
    return lambda: model.simulate(data)


def simulate_with(effects: int) -> Work:
    """A chain of so many effects."""
    model = Model((BoucWen(), ARX, *map(switched_on, ADDED[: effects - 2])), PERIOD)
    data = record(200_000)
    return lambda: model.simulate(data)


def linearise(numbers: int) -> Work:
    """Sensitivities to so many numbers."""
    model, data = Model((BoucWen(), ARX), PERIOD), record(200_000)
    wanted = [n for n in model.values() if n != "arx.delay"][:numbers]
    return lambda: [None for _ in model.linearise([data], wanted)]


def fit_phases(phases: int) -> Work:
    """A fit of the loop to so many phases."""
    truth = Model((BoucWen(), ARX), PERIOD)
    data = record(30_000)
    measured = truth.simulate(data)[0]
    records = [Record(data.voltage, measured, PERIOD, f"sine_{k}hz") for k in range(phases)]
    start = truth.with_values({"bouc_wen.beta": 5.0})
    return lambda: fit(start, records, ["bouc_wen.A", "bouc_wen.beta", "bouc_wen.gamma"], max_iterations=4)


def follow(axes: int) -> Work:
    """Streams of so many axes, block by block."""
    data = record(100 * BLOCK)
    model = Model((BoucWen(), ARX), PERIOD)
    blocks = [np.array(data.voltage[k : k + BLOCK]) for k in range(0, data.size, BLOCK)]

    def work() -> None:
        predictors = [Predictor(PERIOD, model) for _ in range(axes)]
        for k, block in enumerate(blocks):
            for predictor in predictors:
                predictor.predict(k * BLOCK, round(k * BLOCK * PERIOD * 1e9), block, block)

    return work


CASES: tuple[Case, ...] = (
    ("simulation", "samples", (10_000, 100_000, 1_000_000, 10_000_000), simulate),
    ("simulation", "effects", (2, 4, 6, 9), simulate_with),
    ("sensitivities", "numbers", (2, 5, 10, 21), linearise),
    ("fit", "phases", (1, 2, 4, 8, 16), fit_phases),
    ("streams", "axes", (1, 2, 4, 8), follow),
)


def exponent(sizes: Sequence[int], times: Sequence[float]) -> float:
    """Slope on log axes, least squares."""
    return float(np.polyfit(np.log(sizes), np.log(times), 1)[0])


def draw(curves: Sequence[tuple[str, Sequence[int], Sequence[float]]], path: Path) -> None:
    """All curves on log axes, each relative to its first point."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(figsize=(6.0, 4.0), layout="constrained")
    for label, sizes, times in curves:
        axes.loglog(np.array(sizes) / sizes[0], np.array(times) / times[0], "o-", label=label)
    axes.set_xlabel("size, relative to the smallest [1]")
    axes.set_ylabel("processor time, relative to the smallest [1]")
    axes.legend()
    figure.savefig(path)
    pyplot.close(figure)


def arguments(parser: argparse.ArgumentParser) -> None:
    """Options."""
    parser.add_argument("--figure", type=Path, help="file for a figure of the curves")


def run(options: argparse.Namespace) -> list[Figures]:
    """One row for every kind of growth."""
    rows, curves = [], []
    for what, against, sizes, make in CASES:
        times = [seconds(make(size), repeats=3)[0] for size in sizes]
        slope = exponent(sizes, times)
        listed = ", ".join(f"{size:g}: {time:.3g}" for size, time in zip(sizes, times, strict=True))
        rows.append((what, against, slope, listed))
        curves.append((f"{what} against {against}: {slope:.2f}", sizes, times))
    if options.figure:
        draw(curves, options.figure)
    return [Figures("Growth of processor time", ("work", "against", "exponent", "size: s"), rows)]


if __name__ == "__main__":
    alone(__name__)
