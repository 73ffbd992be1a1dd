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

"""Corrections without a name on independent plants: number of accepted ones, and their influence on later records.

Every plant hides one thing that the gap finder cannot name: an effect that is not in the catalogue, or an effect whose
family was removed from it. If the verdict is "unknown", the correction is judged on a second experiment with the same
plant, with other rates and amplitudes, which was not used before.

    python -m benchmarks.corrections --seeds 2 --json corrections.json
"""

from __future__ import annotations

import argparse
import json
import time
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np
from rich.table import Table

from benchmarks.figures import console
from benchmarks.independent_plant import NATIVE, Plant
from benchmarks.naming_cases import UNKNOWN, Case
from benchmarks.naming_experiments import FULL, corners, ladder, multisine, noise, rich, triangle
from piezo_hysteresis.discrepancy import diagnose, floors, measure_gap, noise_floors, stroke
from piezo_hysteresis.discrepancy.search.selection_result import explained
from piezo_hysteresis.effects import BY_NAME
from piezo_hysteresis.record import Experiment, Record
from piezo_hysteresis.report.figures.diagnosis.correction import correction as draw_correction
from piezo_hysteresis.report.figures.drawing import Drawing

Array = np.ndarray

NOISE = 5e-4
"""Of the stroke, rms per sample at the fastest period."""
ABSENT = (
    "creep",
    "hysteresis_memory",
    "asymmetric_hysteresis",
    "backlash",
    "sensor_nonlinearity",
    "softening",
    "rate_dependent_hysteresis",
    "amplifier_saturation",
    "thermal_drift",
    "axis_coupling",
)
"""Effects whose family is removed from the library."""
WORSE = 1.05
"""Ratio of the error to that without the correction, from which a record counts as worse."""


def _soft_stop(plant: Plant, u: Array, y: Array, t: Array) -> Array:
    """From a position on the stage pushes a second spring."""
    return y - 0.08 * plant.stroke * np.maximum(0.0, y / plant.stroke - 0.6)


def _scale_error(plant: Plant, u: Array, y: Array, t: Array) -> Array:
    """Periodic error of a scale with a long period."""
    return y + 0.004 * plant.stroke * np.sin(2 * np.pi * y / (0.31 * plant.stroke))


def _guide_friction(plant: Plant, u: Array, y: Array, t: Array) -> Array:
    """Friction of a guide that acts on the position, not on the voltage."""
    half, held, at = 0.012 * plant.stroke, np.empty_like(y), float(y[0])
    for i, now in enumerate(y.tolist()):
        at = min(max(at, now - half), now + half)
        held[i] = at
    return y + 0.3 * (held - y)


def _two_bumps(plant: Plant, u: Array, y: Array, t: Array) -> Array:
    """Sensor target that is not flat at two positions."""
    x = y / plant.stroke
    return y + 0.006 * plant.stroke * (np.exp(-(((x - 0.3) / 0.06) ** 2)) - np.exp(-(((x - 0.55) / 0.09) ** 2)))


def _creep_of_level(plant: Plant, u: Array, y: Array, t: Array) -> Array:
    """Creep that grows with the square of the level."""
    level = (y / plant.stroke) ** 2 * np.sign(y)
    period, late = float(t[1] - t[0]), np.zeros_like(y)
    for tau in 10.0 ** np.arange(-2.0, 3.0, 0.5):
        fade, x = float(np.exp(-period / tau)), float(level[0])
        for i, now in enumerate(level.tolist()):
            x += (1.0 - fade) * (now - x)
            late[i] += x - level[0]
    return y + 0.004 * plant.stroke * late


OUTSIDE = {f.__name__.strip("_"): f for f in (_soft_stop, _scale_error, _guide_friction, _two_bumps, _creep_of_level)}
"""Effects that are not in the catalogue and that a passive correction may describe."""


def unseen(player: Plant, seed: int) -> Experiment:
    """Waveforms at rates and amplitudes that `rich` does not play, inside of what it spans."""
    rng, clock, records = np.random.default_rng(seed), 0.0, list[Record]()

    def add(phase: str, drive: Array, period: float = NATIVE, averaged: int = 1) -> None:
        nonlocal clock
        records.append(player.play(drive * player.volt / FULL, period, phase, rng, clock, averaged))
        clock += drive.size * period + 0.5

    for frequency, height, middle in (
        (30, 2.0, 3.0),
        (70, 1.2, 4.5),
        (150, 2.4, 3.5),
        (250, 0.7, 2.5),
        (350, 1.7, 4.0),
    ):
        t = np.arange(0.0, max(3, frequency // 20) / frequency, NATIVE)
        add(f"sine_{frequency}hz", middle + height * np.sin(2 * np.pi * frequency * t))
    add("sine_3hz", 4.0 + 1.8 * np.sin(2 * np.pi * 3.0 * np.arange(0.0, 1.0, 1e-4)), 1e-4, 10)
    add("triangle", triangle((7, 5, 3), 1e-4, 2.0), 1e-4, 10)
    add("triangle", triangle((5,), 1e-4, 7.0), 1e-4, 10)
    add("staircase", ladder((0, 1, 3, 5, 7, 4, 1), 2.0, 60.0, 1e-3), 1e-3, 10)
    add("minor_loops", corners([0, 7, 2.5, 6.5, 3, 5.5, 4, 7, 1, 5], 1e-4), 1e-4, 10)
    for rms in (0.5, 0.8):
        add("multisine", multisine(rms, rng, 30.0, 1000.0))
    add("noise", noise(0.07, 0.25, rng))
    return Experiment(tuple(records), source="waveforms that were not used")


@dataclass(frozen=True)
class Outcome:
    """One plant; shares and ratios are of the second experiment."""

    label: str
    seed: int
    verdict: str
    form: str
    accepted: bool
    reason: str
    removed: float
    before: float
    after: float
    worse: int
    records: int
    worst: float
    seconds: float


def cases(seeds: int) -> Iterator[Case]:
    """Every hidden effect once for each seed."""
    for seed in range(seeds):
        for name, effect in {**OUTSIDE, **UNKNOWN}.items():
            extra = {"unknown": effect, "unknown_name": (name,)}
            yield Case("uncatalogued", (), seed + 40, NOISE, extra=extra)
        for name in ABSENT:
            yield replace(Case("effects", (name,), seed + 40, NOISE), group="absent", without=(BY_NAME[name].family,))


def answer(case: Case) -> tuple[Outcome, Drawing | None]:
    """Diagnose the first experiment, and judge the correction on the second; with a picture of its shape."""
    player, seed = case.player()
    first, second = rich(player, seed, case.layout), unseen(player, seed + 1)
    begin = time.process_time()
    found = diagnose(first, effects=case.library)
    seconds = time.process_time() - begin
    correction = found.correction
    removed, before, after, ratios = 0.0, np.nan, np.nan, np.empty(0)
    if correction is not None and correction.model is not None and found.model is not None:
        records, sigma = second.records, noise_floors(second.records)
        least, chosen = floors(records, sigma), range(len(records))
        models = (found.model, correction.model)
        gap = measure_gap(models, records, chosen, least, stroke(records), unseen=True)
        sizes = np.array([(p.before, p.after, p.floor) for p in gap.per_phase])
        ratios = sizes[:, 1] / sizes[:, 0]
        null = float(np.mean((sigma / least) ** 2))
        first_gap, last_gap = np.mean((sizes[:, :2] / sizes[:, 2:]) ** 2, axis=0)
        removed = explained(first_gap, last_gap, null)
        before, after = gap.before, gap.after
    outcome = Outcome(
        label=case.label,
        seed=case.seed,
        verdict=str(found.verdict),
        form="" if correction is None else correction.effect.name,
        accepted=correction is not None and correction.accepted,
        reason="" if correction is None else correction.refusal,
        removed=removed,
        before=before,
        after=after,
        worse=int(np.sum(ratios > WORSE)),
        records=ratios.size,
        worst=float(ratios.max(initial=0.0)),
        seconds=seconds,
    )
    return outcome, draw_correction(found.answer())


def main() -> None:
    """Run, print and write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=2)
    parser.add_argument("--only", default="", help="cases whose label contains this")
    parser.add_argument("--json", type=Path)
    parser.add_argument("--picture", type=Path, help="draw the last correction that is accepted")
    args = parser.parse_args()
    out, outcomes = console(), list[Outcome]()
    for case in (c for c in cases(args.seeds) if args.only in c.label):
        found, drawing = answer(case)
        if drawing is not None and args.picture is not None:
            drawing.save_picture(args.picture)
        outcomes.append(found)
        said = f"{found.form} {found.removed:.2f} worst {found.worst:.2f}" if found.accepted else found.reason or "none"
        out.print(f"{found.label} seed {found.seed}: {found.verdict}; {said}; {found.seconds:.1f} s", highlight=False)
        if args.json is not None:
            args.json.write_text(json.dumps([asdict(o) for o in outcomes], indent=1))
    out.print(report(outcomes))


def report(outcomes: list[Outcome]) -> Table:
    """One row for each hidden effect, and their sum."""
    table = Table("hidden", "unknown", "accepted", "form", "gap removed", "records worse by 5 %", "worst record")
    by_label: dict[str, list[Outcome]] = defaultdict(list)
    for outcome in outcomes:
        by_label[outcome.label].append(outcome)
    for label, group in {**by_label, "all": outcomes}.items():
        unknown = [o for o in group if o.verdict == "unknown"]
        taken = [o for o in unknown if o.accepted]
        removed = ", ".join(f"{100 * o.removed:.0f} %" for o in taken)
        if label == "all" and taken:
            removed = f"least {100 * min(o.removed for o in taken):.0f} %"
        forms = ", ".join(sorted({o.form for o in taken}))
        worse = f"{sum(o.worse for o in taken)} of {sum(o.records for o in taken)}" if taken else ""
        worst = f"{max(o.worst for o in taken):.2f}" if taken else ""
        table.add_row(label, str(len(unknown)), str(len(taken)), forms if label != "all" else "", removed, worse, worst)
    return table


if __name__ == "__main__":
    main()
