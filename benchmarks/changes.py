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

"""Changes between two recordings of one stage: are they named with their size, and does an unchanged stage get no name?

Every stage of `benchmarks.nanopositioner` is recorded and identified, then recorded on another day with one change, or
without a change. Delays and time constants go from a tenth of a sample to tens of samples. The stages that did not
change are also recalibrated from one sine, and judged by the others.

    python -m benchmarks.changes --stages 8
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from benchmarks.figures import Cell, Figures, alone
from benchmarks.nanopositioner import Nanopositioner, growing_sine
from piezo_hysteresis.changes.parameter_changes import find_change
from piezo_hysteresis.changes.recalibration import recalibrate
from piezo_hysteresis.identification.free_run_error import errors, free_per_record
from piezo_hysteresis.identification.identify import identify
from piezo_hysteresis.identification.records.noise_floor import floors
from piezo_hysteresis.model.model import Model
from piezo_hysteresis.record import Experiment

PERIOD = 5e-4
"""Sample period [s]."""
FREQUENCIES = (1.0, 10.0, 60.0)
"""Of the growing sines of every recording [Hz]."""
LEAST = 0.95
"""Share of the changed stages whose family has to be right; of the unchanged ones none may get a name."""
WORSE = 2.0
"""Largest ratio of the errors of an unchanged stage at other rates, after and before a recalibration from one rate."""


def played(stage: Nanopositioner, triangles: bool) -> Experiment:
    """A recording: a step from rest, a hold, and growing sines or triangles, for every frequency."""
    drives = (growing_sine(f, PERIOD, (0.4, 0.7, 1.0), triangle=triangles) for f in FREQUENCIES)
    names = ("triangle",) * len(FREQUENCIES) if triangles else tuple(f"sine_{f:g}hz" for f in FREQUENCIES)
    return Experiment(tuple(stage.play(u, PERIOD, name) for name, u in zip(names, drives, strict=True)))


def slope_and_loop(stage: Nanopositioner) -> tuple[float, float]:
    """Displacement over the largest drive, and height of its loop in the middle, as a share of it; without any lag."""
    bare = replace(stage, creep_fast=0.0, creep_slow=0.0, noise=0.0, pole=0.0, delay=0.0, mode=0.4 / PERIOD, zeta=0.7)
    quarter = np.linspace(0.0, 1.0, 1000)
    up = np.concatenate((quarter, quarter[::-1]))
    y = bare.play(stage.volt * np.concatenate((up, up)), PERIOD).displacement[up.size :]
    slope = float(np.ptp(y))
    return slope, float(abs(y[500] - y[1500])) / slope


def changes(day: Nanopositioner, before: Nanopositioner) -> Iterator[tuple[str, str, float | None, Nanopositioner]]:
    """What is changed, the family it belongs to, its size where one number has it, and the stage `day` with it."""
    for samples in (0.1, 0.5, 3.0, 30.0):
        late = replace(day, filter_delay=samples * PERIOD)
        yield f"delay {samples:g} samples", "lag", samples * PERIOD, late
    for samples in (0.2, 2.0, 20.0):
        slow = replace(day, filter_pole=samples * PERIOD)
        yield f"pole {samples:g} samples", "lag", samples * PERIOD, slow
    for samples in (0.2, 2.0, 20.0):
        slow = replace(day, filter_drive=samples * PERIOD)
        yield f"pole before the hysteresis {samples:g} samples", "lag", samples * PERIOD, slow
    for samples in (0.5, 2.0, 10.0):
        twice = replace(day, filter_twice=samples * PERIOD)
        yield f"second order {samples:g} samples", "lag", 2.0**0.5 * samples * PERIOD, twice
    for samples in (1.0, 6.0):
        mean = replace(day, filter_mean=samples * PERIOD)
        yield f"moving average, later by {samples:g} samples", "lag", samples * PERIOD, mean
    slope, height = slope_and_loop(before)
    for factor in (1.04, 0.94):
        gain = replace(day, gain=factor * day.gain)
        yield f"gain {100 * factor - 100:+.0f} %", "static", slope_and_loop(gain)[0] / slope - 1.0, gain
    for factor in (1.2, 0.85):
        loop = replace(day, loop=factor * day.loop)
        yield f"loop {100 * factor - 100:+.0f} %", "hysteresis", slope_and_loop(loop)[1] / height - 1.0, loop
    yield "softening 3 %", "dynamics", None, replace(day, softening=0.03)
    yield "drift 1 % in 10 s", "drift", None, replace(day, drift=0.01)
    for drift in (0.05, 0.15):
        yield f"drift {100 * drift:g} % in 10 s", "drift", None, replace(day, drift=drift)
    for factor in (1.5, 2.0, 4.0):
        creeps = replace(day, creep_fast=factor * day.creep_fast, creep_slow=factor * day.creep_slow)
        yield f"creep × {factor:g}", "creep", None, creeps
    for factor in (0.8, 0.93, 1.06):
        yield f"resonance × {factor:g}", "dynamics", (factor - 1.0) * day.mode, replace(day, mode=factor * day.mode)


def named(model: Model, stage: Nanopositioner, triangles: bool) -> tuple[str, float, tuple[float, float]] | None:
    """Family, size and interval of the change that the model's own search finds."""
    records = played(stage, triangles).records
    least = np.maximum(floors(records), float(model.provenance["free_run_error"]))
    change = find_change(model, records, range(len(records)), least.tolist())
    if change is None:
        return None
    size, *interval = change.lag if change.kind.family == "lag" else (change.size, *change.interval_95)
    return change.kind.family, size, (interval[0], interval[1])


def recalibrated(model: Model, day: Experiment, index: int) -> tuple[float, float]:
    """Lag that a recalibration from one record adds [s], and the ratio of the errors of the other records after it."""
    other = Experiment(tuple(r for k, r in enumerate(day.records) if k != index))
    found = recalibrate(model, Experiment((day.records[index],)))
    after, before = (errors(m, other, free_per_record(m, offset=True)).percent for m in (found.model, model))
    return found.lag, after / before


def arguments(parser: argparse.ArgumentParser) -> None:
    """Number of stages."""
    parser.add_argument("--stages", type=int, default=8)
    parser.add_argument("--first", type=int, default=0, help="seed of the first stage")
    parser.add_argument("--triangles", action="store_true", help="triangles instead of sines")


def run(options: argparse.Namespace) -> list[Figures]:
    """One row per change, over all stages."""
    found: dict[str, list[tuple[bool, bool | None, float | None, str]]] = {}
    false = 0
    days: dict[float, list[tuple[float, float]]] = {f: [] for f in FREQUENCIES}
    for seed in range(options.first, options.first + options.stages):
        rng = np.random.default_rng(seed)
        stage = Nanopositioner.random(rng, mode=float(rng.uniform(250.0, 800.0)))
        model = identify(played(stage, options.triangles), memory=True).model
        for _ in range(2):
            day = stage.on_another_day(rng)
            false += named(model, day, options.triangles) is not None
            for index, frequency in enumerate(FREQUENCIES):
                days[frequency].append(recalibrated(model, played(day, options.triangles), index))
        for what, family, size, changed in changes(stage.on_another_day(rng), stage):
            answer = named(model, changed, options.triangles)
            right = answer is not None and answer[0] == family
            holds = error = None
            if right and size is not None and answer is not None:
                low, high = answer[2]
                holds, error = low <= size <= high, abs(answer[1] / size - 1.0)
            found.setdefault(what, []).append((right, holds, error, "none" if answer is None else answer[0]))
    rows: list[tuple[Cell, ...]] = []
    for what, cases in found.items():
        held = [h for _, h, _, _ in cases if h is not None]
        errors = [100.0 * e for _, _, e, _ in cases if e is not None]
        wrong = ", ".join(sorted({name for right, _, _, name in cases if not right}))
        counts = f"{sum(c[0] for c in cases)} of {len(cases)}"
        coverage = f"{sum(held)} of {len(held)}" if held else ""
        rows.append((what, counts, wrong, float(np.median(errors)) if errors else None, coverage))
    every = [c for cases in found.values() for c in cases]
    right = sum(c[0] for c in every)
    held = [c[1] for c in every if c[1] is not None]
    rows.append(("all", f"{right} of {len(every)}", "", None, f"{sum(held)} of {len(held)}"))
    rows.append(("another day, named", f"{false} of {2 * options.stages}", "", None, ""))
    failures = []
    if right < LEAST * len(every):
        failures.append(f"family right in {right} of {len(every)}, promised {LEAST:.0%}")
    if false:
        failures.append(f"{false} unchanged stages got a name, promised 0")
    late = sum(lag != 0.0 for own in days.values() for lag, _ in own)
    ratios = {f: [ratio for _, ratio in own] for f, own in days.items()}
    if late or max(map(max, ratios.values())) > WORSE:
        failures.append(f"recalibration changed {late} lags; errors up to {max(map(max, ratios.values())):.3g} times")
    recalibrations: list[tuple[Cell, ...]] = [
        (f"{f:g}", f"{sum(lag != 0.0 for lag, _ in days[f])} of {len(own)}", float(np.median(own)), max(own))
        for f, own in ratios.items()
    ]
    columns = ("change", "family right", "else", "error of the size, median [%]", "interval contains the size")
    of_one = ("recalibrated from, Hz", "lag changed", "error at the other rates, after over before, median", "largest")
    return [
        Figures("Changes between two recordings", columns, rows, tuple(failures)),
        Figures("Recalibration on another day, from one sine", of_one, recalibrations),
    ]


if __name__ == "__main__":
    alone(__name__)
