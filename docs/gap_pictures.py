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

"""Pictures of docs/gap.md: one diagnosis of a simulated stage that creeps, step by step.

``python docs/pictures.py gap`` simulates the stage, diagnoses it (about a minute) and draws. ``main`` draws from a
diagnosis that is already there.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from functools import cache
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from piezo_hysteresis.discrepancy import Diagnosis, diagnose
from piezo_hysteresis.discrepancy.choice.next_experiment import possible_drives
from piezo_hysteresis.discrepancy.choice.time_to_decide import (
    ERROR_RATE,
    distances,
    expected_log_odds,
    missing_log_odds,
    z_of,
)
from piezo_hysteresis.discrepancy.search.candidate_refits import LEAST_GAIN, refit_candidates
from piezo_hysteresis.discrepancy.search.candidates import FittedCandidate, screen
from piezo_hysteresis.discrepancy.search.refit import without
from piezo_hysteresis.discrepancy.search.selection import REFITS
from piezo_hysteresis.discrepancy.search.selection_result import NAMED, explained
from piezo_hysteresis.effects import CATALOGUE
from piezo_hysteresis.identification.fit.form_uncertainty import ADEQUACY
from piezo_hysteresis.identification.protocol import protocol
from piezo_hysteresis.identification.protocol.drive_limits import DriveLimits
from piezo_hysteresis.identification.records.noise_floor import ADEQUATE, noise_floors, stroke
from piezo_hysteresis.identification.training.training_data import choose_test_records
from piezo_hysteresis.record import Experiment, Record
from piezo_hysteresis.report.figures.style import MEASURED, PREDICTED, SETTINGS, canvas
from piezo_hysteresis.report.palette import BLACK, BLUE, GREEN, GREY, ORANGE
from piezo_hysteresis.stage.plant import PlantParameters
from piezo_hysteresis.stage.simulated import SimulatedStage

HIDDEN = {"creep.gamma": 0.015}
"""What the simulated stage does and the model does not know."""
POINTS = 2000
"""Points of a curve at most."""


def example() -> Diagnosis:
    """A stage that creeps, recorded with the protocol ``rich``, and its diagnosis."""
    stage = SimulatedStage(PlantParameters().with_values(HIDDEN), seed=1)
    records: list[Record] = []
    for phase in protocol.rich(DriveLimits(), 1):
        records.append(stage.play(phase.voltage, phase.name, continues=bool(records), average=phase.stored_every))
    return diagnose(Experiment(tuple(records)))


def labels(records: tuple[Record, ...]) -> list[str]:
    """Names of the phases, numbered where a name occurs more than once."""
    names = [r.phase.replace("_", " ") for r in records]
    return [f"{n} {names[: i + 1].count(n)}" if names.count(n) > 1 else n for i, n in enumerate(names)]


def used(records: tuple[Record, ...]) -> list[int]:
    """Records that take part in the search: conditioning and hold only bring the stage into its state."""
    return [i for i, r in enumerate(records) if r.phase not in ("conditioning", "hold")]


def floor(diagnosis: Diagnosis) -> Figure:
    """Step 1: the noise floor of every record."""
    records = diagnosis.experiment.records
    chosen = used(records)
    figure, ((axes,),) = canvas(1, 1, 3.2)
    noise = 100.0 * noise_floors(records) / stroke(records)
    axes.bar(np.arange(len(chosen)), noise[chosen], color=BLUE)
    axes.axhline(100.0 * ADEQUACY, color=ORANGE, linestyle="--", label="adequacy floor, 0.03 % of the range")
    names = labels(records)
    axes.set_xticks(np.arange(len(chosen)), [names[i] for i in chosen], rotation=60, ha="right")
    axes.set(title="Noise floor of each record", ylabel="noise, RMS [% of range]")
    axes.set_ylim(0.0, 1.3 * noise[chosen].max())
    axes.legend(loc="upper right")
    return figure


def roles(diagnosis: Diagnosis) -> Figure:
    """Step 2: training records and test records."""
    records = diagnosis.experiment.records
    tests = choose_test_records(records, used(records))
    kinds = {"test record": ORANGE, "training record": BLUE, "brings the stage into its state": GREY}
    figure, ((axes,),) = canvas(1, 1, 3.4)
    for k, record in enumerate(records):
        name = tuple(kinds)[0 if k in tests else 1 if k in used(records) else 2]
        voltage = record.voltage[:: max(1, record.size // POINTS)]
        axes.plot(k + np.linspace(0.05, 0.95, voltage.size), voltage, color=kinds[name], linewidth=0.7)
    for name, colour in kinds.items():
        axes.plot([], [], color=colour, label=name)
    axes.set_xticks(np.arange(len(records)) + 0.5, labels(records), rotation=60, ha="right")
    axes.set(title="Role of each record", ylabel="drive voltage u [V]")
    axes.legend(ncols=3, loc="lower center", bbox_to_anchor=(0.5, 1.08))
    return figure


def baseline(diagnosis: Diagnosis) -> Figure:
    """Step 3: what the refitted baseline leaves in the staircase."""
    records = diagnosis.experiment.records
    assert diagnosis.baseline is not None
    number = next(i for i, r in enumerate(records) if r.phase == "staircase")
    record, simulated = records[number], list(diagnosis.baseline.simulate(records))[number]
    figure, ((above,), (below,)) = canvas(2, 1, 4.2, sharex=True)
    above.plot(record.time - record.start_time, 1e6 * record.displacement, **MEASURED, label="measured")
    above.plot(record.time - record.start_time, 1e6 * simulated, **PREDICTED, label="refitted baseline")
    above.set(title="Staircase: displacement", ylabel="y [µm]")
    above.legend()
    below.plot(record.time - record.start_time, 1e9 * (record.displacement - simulated), color=ORANGE, linewidth=0.8)
    below.set(title="Residual e = measured - simulated", xlabel="time in the record [s]", ylabel="e [nm]")
    return figure


def where(diagnosis: Diagnosis) -> Figure:
    """Step 4: shares of the residual along two axes."""
    figure, (pair,) = canvas(1, 2, 3.4)
    for axes, share in zip(pair, diagnosis.where, strict=False):
        names = [re.sub(r"^(\S+) to inf", r"above \1", name.replace("_", " ")) for name, _ in share.bins]
        axes.barh(np.arange(len(names)), [100.0 * s for _, s in share.bins], color=BLUE)
        axes.set_yticks(np.arange(len(names)), names, fontsize=8)
        axes.invert_yaxis()
        axes.set(title=share.axis.replace("_", " "), xlabel="share of the residual power [%]")
    return figure


def missing(diagnosis: Diagnosis) -> Figure:
    """Step 5: R of every training record, before and after."""
    assert diagnosis.selection is not None
    before, after = diagnosis.selection.steps[0].before.ratios, diagnosis.selection.score.ratios
    figure, ((axes,),) = canvas(1, 1, 2.8)
    at = 1 + np.arange(before.size)
    axes.semilogy(at, before, "o", color=BLUE, label="baseline")
    axes.semilogy(at, after, "s", color=GREEN, label="with the named effect")
    axes.axhline(np.sqrt(ADEQUATE), color=ORANGE, linestyle="--", label="limit: mean of R² = 1.5")
    axes.set_xticks(at)
    title = "Error of each record in units of its floor, predicted from the other records"
    axes.set(title=title, xlabel="training record", ylabel="R [1]")
    axes.legend()
    return figure


def screening(diagnosis: Diagnosis) -> Figure:
    """Step 6: predicted gain of every effect of the catalogue."""
    assert diagnosis.selection is not None
    first = diagnosis.selection.steps[0]
    found = screen(diagnosis.selection.baseline, diagnosis.selection.accepted[0].best.training_data, CATALOGUE)
    gains = sorted(((max(0.0, first.before.cost - c.score.cost), c.name) for c in found), reverse=True)
    figure, ((axes,),) = canvas(1, 1, 4.0)
    axes.barh(np.arange(len(gains)), [g for g, _ in gains], color=[GREEN, *[BLUE] * (len(gains) - 1)])
    axes.set_yticks(np.arange(len(gains)), [n for _, n in gains], fontsize=8)
    axes.invert_yaxis()
    axes.set(title="Predicted gain of each effect", xlabel="gain G in mean ln R² on records left out [1]")
    return figure


@cache
def refits(diagnosis: Diagnosis) -> tuple[dict[str, float], list[FittedCandidate]]:
    """Predicted gain of the best candidates by name, and their joint refits, best first."""
    assert diagnosis.selection is not None
    selection = diagnosis.selection
    before = selection.steps[0].before
    found = screen(selection.baseline, selection.accepted[0].best.training_data, CATALOGUE)[:REFITS]
    predicted = {c.name: max(0.0, before.cost - c.score.cost) for c in found}
    return predicted, refit_candidates(selection.baseline, found, before, lambda word, fraction: None)


def refitting(diagnosis: Diagnosis) -> Figure:
    """Step 7: gain of the best candidates, predicted and after the joint refit."""
    assert diagnosis.selection is not None
    predicted, fitted = refits(diagnosis)
    cost = diagnosis.selection.steps[0].before.cost
    reached = {c.name: max(0.0, cost - c.score.cost) for c in fitted}
    names = sorted(predicted, key=lambda name: -reached.get(name, 0.0))
    figure, ((axes,),) = canvas(1, 1, 3.2)
    at = np.arange(len(names))
    axes.barh(at - 0.2, [predicted[n] for n in names], 0.36, color=GREY, label="predicted in step 6")
    axes.barh(at + 0.2, [reached.get(n, 0.0) for n in names], 0.36, color=BLUE, label="after the joint fit")
    for k, name in enumerate(names):
        if name not in reached:
            axes.annotate("not fitted: too far behind", (0.0, k + 0.2), (4, 0), textcoords="offset points", va="center")
    axes.set_yticks(at, names)
    axes.invert_yaxis()
    axes.set(title="Gain of the best candidates", xlabel="gain G in mean ln R² on records left out [1]")
    axes.legend(loc="lower right")
    return figure


def acceptance(diagnosis: Diagnosis) -> Figure:
    """Step 8: gain of every refit beside its limit, and the error that remains."""
    assert diagnosis.selection is not None
    before, null = diagnosis.selection.steps[0].before, diagnosis.selection.null
    _, fitted = refits(diagnosis)
    colours = [GREEN, *[BLUE] * (len(fitted) - 1)]
    figure, ((gains, left),) = canvas(1, 2, 3.2, sharey=True)
    at = np.arange(len(fitted))
    gains.barh(at, [before.cost - c.score.cost for c in fitted], color=colours)
    gains.axvline(LEAST_GAIN, color=ORANGE, linestyle="--", label=f"limit: at least {LEAST_GAIN:g}")
    left.barh(at, [100.0 * (1.0 - explained(before.excess, c.score.excess, null)) ** 2 for c in fitted], color=colours)
    least = 100.0 * (1.0 - NAMED) ** 2
    left.axvline(least, color=ORANGE, linestyle="--", label=f"limit for a name: at most {least:.0f} %")
    alone = without(fitted[0])
    if alone is not None:
        mark = {"marker": "D", "linestyle": "none", "color": BLACK, "label": "beside the model refitted without it"}
        gains.plot(alone.score.cost - fitted[0].score.cost, 0, **mark)
    gains.set_yticks(at, [c.name for c in fitted])
    gains.invert_yaxis()
    gains.set(title="Gain", xlabel="G [1]")
    left.set(title="Error that remains", xlabel="share of V - V₀ [%]")
    for axes in (gains, left):
        axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1.12), fontsize=8)
    return figure


def next_phase(diagnosis: Diagnosis) -> Figure:
    """Step 10: how well each drive, played once, would separate the two best explanations."""
    _, fitted = refits(diagnosis)
    first, second = fitted[:2]
    drives = possible_drives(first.training_data)
    records = {str(k): drive.as_record() for k, drive in enumerate(drives)}
    apart = distances(first.fit.model, second.fit.model, first.training_data, records)
    best: dict[str, tuple[float, float]] = {}
    for drive, distance in zip(drives, apart.values(), strict=True):
        name, z = drive.name.replace("_", " "), z_of(expected_log_odds(distance, first.score.excess, 1))
        best[name] = max(best.get(name, (0.0, 0.0)), (z, drive.duration))
    names = sorted(best, key=lambda name: -best[name][0])
    figure, ((axes,),) = canvas(1, 1, 3.6)
    axes.barh(np.arange(len(names)), [best[n][0] for n in names], color=BLUE)
    axes.axvline(z_of(missing_log_odds({first.name: 0.5, second.name: 0.5}, ERROR_RATE)), color=ORANGE, linestyle="--")
    axes.set_yticks(np.arange(len(names)), [f"{n}, {best[n][1]:.3g} s" for n in names])
    axes.invert_yaxis()
    title = f"How well a drive would separate {first.name} and {second.name}"
    axes.set(title=title, xlabel="expected separation z [standard deviations]")
    return figure


def gap(diagnosis: Diagnosis) -> Figure:
    """Step 9: error of the test records before and after."""
    assert diagnosis.gap is not None
    rows = diagnosis.gap.per_phase
    figure, ((axes,),) = canvas(1, 1, 2.8)
    at = np.arange(len(rows))
    axes.bar(at - 0.27, [r.before for r in rows], 0.25, color=BLUE, label="refitted baseline")
    axes.bar(at, [r.after for r in rows], 0.25, color=GREEN, label="with the named effect")
    axes.bar(at + 0.27, [r.floor for r in rows], 0.25, color=GREY, label="floor")
    names = labels(diagnosis.experiment.records)
    axes.set_xticks(at, [names[r.index] for r in rows])
    axes.set(title="Free-run error on the test records", ylabel="RMS error [% of range]")
    axes.legend()
    return figure


STEPS: dict[str, Callable[[Diagnosis], Figure]] = {
    "floor": floor,
    "roles": roles,
    "baseline": baseline,
    "where": where,
    "missing": missing,
    "screening": screening,
    "refits": refitting,
    "acceptance": acceptance,
    "gap": gap,
    "next": next_phase,
}
"""Every picture, in the order of the page."""


def main(folder: Path, diagnosis: Diagnosis | None = None) -> None:
    """Draw all pictures into `folder`."""
    diagnosis = diagnosis or example()
    print(diagnosis.summary())
    with mpl.rc_context(SETTINGS):
        for name, draw in STEPS.items():
            draw(diagnosis).savefig(folder / f"gap_{name}.png", dpi=110, metadata={"Software": None})
