"""Diagnosis of few records, or of one: the model that predicts best, without a name.

Records that are cut into blocks show what keeps from one block to the next, and a model may be chosen by that. They do
not show what a missing effect does under another drive, so none is named with confidence.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace

import numpy as np

from ...effects import Effect, HysteresisMemory
from ...identification.fit.fit import Progress
from ...identification.fit.normal_equations import Nuisance, residuals
from ...identification.identify import identify
from ...identification.records.leading_step import step_length
from ...model.model import Model
from ...record import Experiment, Record
from ..diagnosis import Diagnosis, Verdict
from ..excitation_check import missing_excitation
from ..gap import measure_gap, stating
from ..next_experiment import decide
from ..residual.localise import localise
from ..residual.noise_floor import floors, noise_floors, stroke
from .baseline import with_zero
from .candidates import FittedCandidate, loop_is_off, score_model
from .cross_validation import ADEQUATE
from .refit import joint
from .selection import select
from .selection_result import Selection, Step, explained
from .training_data import TrainingData, extent_of

BLOCKS = 16
"""Blocks into which the records are cut, about."""
FEWEST = 256
"""Samples of a block at least."""
LAST, PRECISE = 25, 1e-6
"""Linearisations of a fit, and relative decrease of the cost at which it has converged."""


def diagnose_few(
    experiment: Experiment,
    model: Model | None,
    used: Collection[int],
    effects: Collection[type[Effect]],
    progress: Progress,
) -> Diagnosis:
    """Extend the model as far as blocks left out ask for it; the verdict is always unknown.

    Parameters
    ----------
    experiment : Experiment
        Records, in order.
    model : Model or None
        Where to begin; identified from the experiment where None.
    used : collection of int
        Indices of the records in which the drive moves.
    effects : collection of Effect classes
        The library to choose from.
    progress : callable
        Called with a word and the fraction done.
    """
    records = experiment.records
    known = Experiment(records, experiment.source)
    progress("baseline", 0.0)
    state = model or identify(known, progress=lambda word, part: progress(word, 0.2 * part)).model
    start = model or identify(known, memory=True, progress=lambda word, part: progress(word, 0.2 + 0.2 * part)).model
    noise = noise_floors(records)
    least = floors(records, noise)
    blocks, origin = blocks_of(records, used)
    weights = np.array([np.inf if k is None else least[k] for k in origin])
    runs = sum(not r.continues for r in records)
    jumps = tuple(i for i, b in enumerate(blocks) if not b.continues and step_length(records[origin[i] or 0]) == b.size)
    span = extent_of([records[i] for i in used], start)
    training_data = TrainingData(tuple(blocks), weights, Nuisance(offset=runs > 1), span, jumps)
    null = float(np.mean([(noise[i] / least[i]) ** 2 for i in used]))
    baseline = joint(with_zero(state), training_data, LAST, PRECISE)
    before = score_model(baseline.model, training_data)
    steps: list[Step] = []
    now, score = baseline, before
    if HysteresisMemory.name in start and HysteresisMemory.name not in state:
        now = joint(with_zero(start), training_data, LAST, PRECISE)
        score = score_model(now.model, training_data)
        memory = FittedCandidate(now.model[HysteresisMemory.name], training_data, score, now)
        steps.append(Step(before, memory, True, (), ()))
    progress("where", 0.45)
    left = residuals(baseline.model, records, Nuisance(offset=True))
    where = localise([records[i] for i in used], [left[i] for i in used], [least[i] for i in used])
    fitting = [e for e in effects if not (loop_is_off(now.model) and e.host == now.model.hysteresis.name)]
    found = select(now.model, training_data, score, null, fitting, lambda word, part: progress(word, 0.5 + 0.4 * part))
    selection = Selection(baseline.model, found.model, found.score, (*steps, *found.steps), null)
    final_training_data = found.accepted[-1].best.training_data if found.accepted else training_data
    # what was judged on blocks left out is delivered: fitting on would bend it towards the few kinds of record
    scored = selection.accepted[-1].best.fit if selection.accepted else None
    final = scored or baseline
    gap = measure_gap(
        (baseline.model, final.model),
        records,
        sorted(used),
        least.tolist(),
        stroke(records),
        (Nuisance(offset=True), replace(final_training_data.nuisance, offset=True)),
        False,
    )
    names = [s.best.effect.public_name() for s in selection.accepted]
    closed = explained(before.excess, selection.score.excess, null)
    missing = missing_excitation([records[i] for i in used])
    if before.excess <= ADEQUATE:
        message = "the published model reaches the floor, so that the data give no information on further effects"
    elif names:
        message = (
            f"the closest effect is {' with '.join(names)}, which explains {100 * closed:.0f} % of the "
            "gap and was added to the model"
        )
    else:
        message = "no effect of the catalogue improves the prediction of blocks that were left out"
    count = "one record" if len(used) == 1 else f"{len(used)} records"
    reason = "; ".join(
        (f"No effect is named, because {count} cannot distinguish effects", message, *(n.message for n in missing))
    )
    return Diagnosis(
        verdict=Verdict.UNKNOWN,
        reason=f"{reason}.",
        model=stating(final.model, gap.live, stroke(records)),
        baseline=stating(baseline.model, gap.before, stroke(records)),
        selection=selection,
        fit=final,
        where=where,
        gap=gap,
        next_experiment=decide(selection, training_data),
        experiment=experiment.noting(*missing),
    )


def blocks_of(records: Sequence[Record], used: Collection[int]) -> tuple[list[Record], list[int | None]]:
    """Blocks of the records `used`, a leading jump apart, and of which record each is; None where it only carries.

    Parameters
    ----------
    records : sequence of Record
        In order.
    used : collection of int
        Indices of the records to cut.
    """
    length = max(FEWEST, sum(records[i].size for i in used) // BLOCKS)
    blocks: list[Record] = []
    origin: list[int | None] = []
    for index, record in enumerate(records):
        if index not in used:
            blocks.append(record)
            origin.append(None)
            continue
        step = 0 if record.continues else step_length(record)
        count = max(1, round((record.size - step) / length))
        edges = {step, *(step + round(k * (record.size - step) / count) for k in range(1, count))}
        cuts = record.split(*sorted(edges - {0}))
        blocks += [cuts[0], *(replace(c, initial_voltage=None) for c in cuts[1:])]
        origin += [index] * len(cuts)
    return blocks, origin
