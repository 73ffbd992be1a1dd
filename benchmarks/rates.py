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

"""Rates and amplitudes that were left out: how well `identify` predicts them, and whether intervals of the lag hold.

Stages of `benchmarks.nanopositioner`, all numbers drawn, are recorded as laboratories do: a step from rest in the first
sample, a hold, growing sines at three frequencies, 0.02 % noise. Every rate is left out once, then the largest
amplitudes, then all rates but one. The last row has the slowest rate alone and no step. A lag then looks like creep, so
that no error is promised at the fastest rate but the one that the stated uncertainty of the lag allows.

With `--voltage-noise`, the voltage of the records that are fitted was measured with white noise; the stage has not seen
it, and the records that judge have none. With `--period`, the samples are farther apart, and the frequencies lower by
as much: the mode then rings faster than the samples show. With `--filter_drive`, a pole of that time constant is before
the hysteresis. With the other filters, it is behind the sensor: a pole, a Butterworth low-pass of second order, or the
mean of the last samples, which is so much later.

    python -m benchmarks.rates --stages 6
    python -m benchmarks.rates --stages 6 --voltage-noise 0.01
    python -m benchmarks.rates --stages 6 --period 0.005
    python -m benchmarks.rates --stages 6 --filter_drive 0.001
    python -m benchmarks.rates --stages 6 --filter_twice 0.001
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from benchmarks.figures import Cell, Figures, alone
from benchmarks.nanopositioner import Nanopositioner, growing_sine
from piezo_hysteresis.effects import ExtraResonance
from piezo_hysteresis.identification.free_run_error import errors, free_per_record
from piezo_hysteresis.identification.identification import Identification
from piezo_hysteresis.identification.identified_range import LAG_ERROR
from piezo_hysteresis.identification.identify import identify
from piezo_hysteresis.identification.steps.remaining_lag import error_of_lag, lag
from piezo_hysteresis.identification.structure.mode import lag_of_mode, mode_is_inferred
from piezo_hysteresis.record import Experiment

PERIOD = 5e-4
"""Sample period [s]."""
FREQUENCIES = (1.0, 10.0, 60.0)
"""Of the growing sines [Hz]; slower if the sample period is longer."""
HOLD, HELD = 0.4, 60
"""Hold before them: time [s], and smallest number of samples."""
LEVELS = (0.2, 0.4, 0.6, 0.8, 1.0)
"""Amplitudes of the sines, shares of the largest."""
SMALL = 3
"""Levels that are fitted where the largest are left out."""
FILTERS = {
    "filter_drive": "time constant of a pole before the hysteresis",
    "filter_pole": "time constant of a pole behind the sensor",
    "filter_twice": "time constant of a Butterworth low-pass of second order behind the sensor",
    "filter_mean": "delay of a moving average behind the sensor",
}
"""Options for a low-pass in the chain, and what their number is."""
SECOND = 1.5
"""Frequency of a second mode, in units of the first."""
Values = tuple[float, ...]
"""Frequencies [Hz], or levels."""
PROMISED = {
    "rate between two": 0.3,
    "slowest rate": 0.65,
    "fastest rate": 0.65,
    "largest amplitudes": 0.6,
    "all rates but one": 0.65,
}
"""What is left out, to the error in % of range that the median of the stages may have."""


def played(
    stage: Nanopositioner, frequencies: tuple[float, ...], levels: tuple[float, ...] = LEVELS, period: float = PERIOD
) -> Experiment:
    """A record per frequency."""
    hold = max(HOLD, HELD * period)
    drives = ((f"sine_{f:g}hz", growing_sine(f, period, levels, hold=hold)) for f in frequencies)
    return Experiment(tuple(stage.play(u, period, name) for name, u in drives))


def measured(experiment: Experiment, noise: float, rng: np.random.Generator) -> Experiment:
    """The experiment with noise of that standard deviation [V] in its voltage."""
    records = [replace(r, voltage=r.voltage + noise * rng.standard_normal(r.size)) for r in experiment]
    return replace(experiment, records=tuple(records))


def without_step(stage: Nanopositioner, frequency: float, period: float) -> Experiment:
    """A record of growing sines that begin at rest."""
    swing = 0.5 * (1.0 - np.cos(2.0 * np.pi * frequency * period * np.arange(round(2.0 / frequency / period))))
    drive = stage.volt * np.concatenate([level * swing for level in LEVELS])
    return Experiment((stage.play(drive, period, f"sine_{frequency:g}hz"),))


def cases(low: float, middle: float, high: float) -> Iterator[tuple[str, Values, Values, Values]]:
    """What is left out; frequencies and levels fitted; frequencies that judge."""
    frequencies = low, middle, high
    yield "rate between two", (low, high), LEVELS, (middle,)
    yield "slowest rate", (middle, high), LEVELS, (low,)
    yield "fastest rate", (low, middle), LEVELS, (high,)
    yield "largest amplitudes", frequencies, LEVELS[:SMALL], frequencies
    for f in frequencies:
        yield "all rates but one", (f,), LEVELS, tuple(g for g in frequencies if g != f)


def lag_holds(found: Identification, stage: Nanopositioner, period: float = PERIOD) -> bool:
    """Whether the 95 % interval of the lag of delay, mode and dynamics holds that of the samples of the stage."""
    value, error = lag(found.fit)
    model = found.model
    if ExtraResonance.name in model and not mode_is_inferred(model):  # that of an inferred mode is part of the lag
        value += lag_of_mode(model)
    return abs(value - stage.sampled_lag(period)) < 1.96 * error


def arguments(parser: argparse.ArgumentParser) -> None:
    """Number of stages."""
    parser.add_argument("--stages", type=int, default=6)
    parser.add_argument("--first", type=int, default=0, help="seed of the first stage")
    parser.add_argument("--period", type=float, default=PERIOD, help="sample period [s]")
    parser.add_argument("--voltage-noise", type=float, default=0.0, help="of the fitted records [V]")
    parser.add_argument("--slew", type=float, default=0.0, metavar="SLOPE", help="largest slope of the amplifier [V/s]")
    parser.add_argument("--second-mode", type=float, default=0.0, metavar="SHARE", help="of a second mode")
    for name, help in FILTERS.items():
        parser.add_argument(f"--{name}", type=float, default=0.0, metavar="TIME", help=f"{help} [s]")


def run(options: argparse.Namespace) -> list[Figures]:
    """One row per kind of what is left out."""
    found: dict[str, list[tuple[float, bool]]] = {}
    one_rate: list[tuple[float, float, bool]] = []
    period = options.period
    low, middle, high = (f * PERIOD / period for f in FREQUENCIES)
    filtered = {name: getattr(options, name) for name in FILTERS}
    for seed in range(options.first, options.first + options.stages):
        rng = np.random.default_rng(seed)
        mode = float(rng.uniform(250.0, 800.0))
        stage = Nanopositioner.random(rng, mode=mode, second_share=options.second_mode, **filtered)
        stage = replace(stage, second_mode=SECOND * mode, slew=options.slew)
        for what, fitted, levels, judged in cases(low, middle, high):
            recorded = measured(played(stage, fitted, levels, period), options.voltage_noise, rng)
            identified = identify(recorded, memory=True)
            unseen = played(stage, judged, LEVELS, period)
            rows = errors(identified.model, unseen, free_per_record(identified.model, offset=True)).rows
            holds = lag_holds(identified, stage, period)
            found.setdefault(what, []).append((max(r.percent for r in rows), holds))
        recorded = measured(without_step(stage, low, period), options.voltage_noise, rng)
        slowest = identify(recorded, memory=True)
        (row,) = errors(
            slowest.model, without_step(stage, high, period), free_per_record(slowest.model, offset=True)
        ).rows
        uncertainty = float(slowest.model.provenance[LAG_ERROR])
        one_rate.append((row.percent, 100.0 * error_of_lag(uncertainty, high), lag_holds(slowest, stage, period)))
    table: list[tuple[Cell, ...]] = []
    failures = []
    for what, values in found.items():
        worst = [percent for percent, _ in values]
        median, promised = float(np.median(worst)), PROMISED[what]
        table.append((what, median, max(worst), promised, f"{sum(h for _, h in values)} of {len(values)}"))
        if median > promised:
            failures.append(f"{what}: {median:.3g} %, promised {promised}")
    reached, allowed, holds = (list(column) for column in zip(*one_rate, strict=True))
    what = "all but the slowest, no step"
    held = f"{sum(holds)} of {len(holds)}"
    table.append((what, float(np.median(reached)), max(reached), float(np.median(allowed)), held))
    failures += [f"{what}: {r:.3g} %, allowed {a:.3g}" for r, a in zip(reached, allowed, strict=True) if r > a]
    columns = ("left out", "median", "largest", "promised", "interval holds the lag")
    return [Figures("Free-run error on the records that were left out, % of range", columns, table, tuple(failures))]


if __name__ == "__main__":
    alone(__name__)
