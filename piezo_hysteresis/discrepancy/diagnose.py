"""`diagnose`: floor → where → candidates → add → gap → next experiment; each step a function of its own."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from contextlib import suppress
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..effects import CATALOGUE, Effect
from ..errors import DivergenceError, IdentificationError, ModelError, ParameterError
from ..identification.carried import select as select_records
from ..identification.fit import Fit, Progress
from ..identification.normal_equations import Nuisance, residuals
from ..identification.roles import CARRYING
from ..model import Model
from ..one_core import on_one_core
from ..record import Experiment, Notice, Record
from .baseline import exact, start_models
from .candidates import score_baseline, score_model
from .coarseness import coarseness
from .diagnosis import Diagnosis, Verdict
from .evidence import Evidence, extent_of
from .explicit_step import KIND, is_stepped, without_steps
from .few_records import diagnose_few
from .gap import Gap, measure_gap
from .held_out import ADEQUATE
from .localise import localise
from .next_experiment import decide
from .noise_floor import floors, noise_floors, stroke
from .reach import beyond_reach
from .refit import clearly_better, joint, renewed, restart
from .sampling import NOISE_WIDTH, at_period, common_period, less, quieted, shortened, slowed, voltage_noise
from .selection import NAMED, select
from .split import reporting
from .steps import Selection
from .verdict import FEWEST, is_makeshift, verdict_of

Array = NDArray[np.float64]

SEARCHED, FITTED = 6_000, 50_000
"""Samples of a fast record that take part in the search, and in the last fit."""
LAST, PRECISE = 25, 1e-4
"""Linearisations of the last fit, and relative decrease of the cost at which it has converged."""
UNSURE = 0.3
"""Share of what slow samples have lost that counts as floor: the rest is made good."""
NOISY, WORTHWHILE = 1.1, 0.95
"""Cost over that of noise from which it is begun anew, and share of it that may be left for another time."""
STEPS_LEAVE = 10.0
"""Cost that may be left once the changes of an explicit step are taken out before anything is named."""
VOLTAGE_NOISE = "voltage_noise"
"""Kind of the notice of an experiment whose voltage is followed but for its noise."""
IDLE = ("idle", "hold", *CARRYING)
"""Phases that only bring the stage from one state to another."""


@on_one_core
def diagnose(
    experiment: Experiment,
    model: Model | None = None,
    *,
    effects: Collection[type[Effect]] = CATALOGUE,
    progress: Progress | None = None,
) -> Diagnosis:
    """Find where simulation and measurement disagree, name the missing effect, add it, and show the gap shrink.

    Parameters
    ----------
    experiment : Experiment
        Records of any kind; the more kinds, and the more realisations of each, the surer the name.
    model : Model, optional
        Where the search begins; identified from the experiment by default.
    effects : collection of Effect classes
        The library to choose from; the whole catalogue by default.
    progress : callable, optional
        Called with a word and the fraction done.

    Returns
    -------
    Diagnosis
        Named, nothing missing, or unknown, with the extended model.

    Raises
    ------
    IdentificationError
        If nothing in the experiment moves.
    ModelError
        If the records are faster than the model.
    """
    with np.errstate(over="ignore", invalid="ignore"):  # trials that run away are told by their cost
        return _diagnosed(experiment, model, effects, progress or (lambda word, fraction: None))


def _diagnosed(
    experiment: Experiment,
    model: Model | None,
    effects: Collection[type[Effect]],
    tell: Progress,
    known: Selection | None = None,
) -> Diagnosis:
    """The diagnosis; `known` is a search whose model tells what slow samples have lost better than its baseline."""
    noise_of_drive = voltage_noise(experiment.records)
    if noise_of_drive.any():
        experiment = _quieted(experiment, noise_of_drive)
    records = tuple(slowed(r) for r in experiment.records)
    severe = [n for n in experiment.notices if n.severe]
    usable = [i for i, r in enumerate(records) if r.phase not in IDLE and not r.truncated]
    moving = [i for i, r in enumerate(records) if np.ptp(np.append(r.voltage, r.settled_voltage)) > 0.0]
    if not moving:
        raise IdentificationError("diagnose: the drive does not move in any record; expected loops, steps or noise")
    moving = [i for i in moving if i in usable]
    if severe:
        return _undecided(experiment, model, severe)
    if len(moving) < FEWEST:
        return diagnose_few(experiment, model, moving, effects, tell)

    tell("baseline", 0.0)
    spared = reporting(records, usable)
    fitted = [i for i in usable if i not in spared]
    noise, least, span = noise_floors(records), floors(records), stroke(records)
    at_full_rate = [r for r, given in zip(records, experiment, strict=True) if r.sample_period == given.sample_period]
    period = model.sample_period if model is not None else common_period(at_full_rate or records)
    records = tuple(at_period(r, period) for r in records)
    first_model = known.baseline if known is not None else model
    starts = iter((first_model,)) if first_model is not None else start_models(records, fitted)
    start = exact(next(starts))
    extent = extent_of([records[i] for i in usable], start)

    def gathered(records: Sequence[Record], least: Array) -> Evidence:
        kept, sizes = select_records(shortened(records, SEARCHED), least.tolist(), fitted)
        return Evidence(tuple(kept), np.array(sizes), Nuisance(), extent)

    evidence = gathered(records, least)
    tell("baseline, jointly", 0.2)
    baseline = joint(start, evidence, LAST, PRECISE)
    given, lost = records, coarseness(known.model if known is not None else baseline.model, records)
    told = {n.kind for n in experiment.notices}
    if VOLTAGE_NOISE not in told and any(c.any() for c in lost):  # averages of noise would turn back and forth
        records = less(records, lost)
        least = np.hypot(least, [UNSURE * np.sqrt(np.mean(c**2)) for c in lost])
        evidence = gathered(records, least)
        tell("baseline, jointly", 0.3)
        baseline = joint(baseline.model, evidence, LAST, PRECISE)
    evidence, score = score_baseline(baseline.model, evidence)
    if score.excess > ADEQUATE:
        with suppress(DivergenceError, IdentificationError, ModelError, ParameterError):
            for anew in starts:
                other = joint(exact(anew), evidence, LAST, PRECISE)
                if clearly_better(other, baseline, evidence):
                    baseline = other
        baseline = renewed(baseline, evidence, LAST, PRECISE)
        score = score_model(baseline.model, evidence)
    may_be_stepped = KIND not in told
    if score.excess > ADEQUATE and may_be_stepped and is_stepped(baseline.model, evidence, leaves=STEPS_LEAVE):
        return _diagnosed(without_steps(experiment, baseline.model), model, effects, tell)
    null = float(np.mean([(noise[i] / least[i]) ** 2 for i in fitted]))

    tell("where", 0.35)
    left = residuals(baseline.model, records, evidence.nuisance)
    where = localise([records[i] for i in usable], [left[i] for i in usable], [least[i] for i in usable])
    stepped = False

    def is_in_vain(model: Model, evidence: Evidence) -> bool:
        nonlocal stepped
        stepped = may_be_stepped and is_stepped(model, evidence)
        return stepped

    selection = select(
        baseline.model,
        evidence,
        score,
        null,
        effects,
        lambda word, part: tell(word, 0.4 + 0.4 * part),
        is_in_vain,
    )
    if stepped:
        return _diagnosed(without_steps(experiment, selection.model), model, effects, tell)
    if selection.score.excess > ADEQUATE and selection.accepted and known is None and VOLTAGE_NOISE not in told:
        again = coarseness(selection.model, given)
        if any(np.std(a - b) > f for a, b, f in zip(again, lost, least, strict=True)):
            return _diagnosed(experiment, model, effects, tell, selection)
    tell("gap", 0.85)
    named = bool(selection.accepted) and selection.explained(selection.score) >= NAMED and not is_makeshift(selection)
    whole = tuple(select_records(shortened(records, FITTED), least.tolist(), fitted)[0])
    plain = baseline.model if selection.accepted else selection.model  # the search may have found better dynamics
    first = joint(plain, replace(evidence, records=whole), LAST, PRECISE)
    final_evidence = selection.accepted[-1].best.evidence if named else evidence
    final = _finished(selection, replace(final_evidence, records=whole), null) if named else first
    chosen = spared or tuple(fitted)

    def gap_of(last: Fit, nuisance: Nuisance) -> Gap:
        models, nuisances = (first.model, last.model), (evidence.nuisance, nuisance)
        return measure_gap(models, records, chosen, least.tolist(), span, nuisances, bool(spared))

    gap = gap_of(final, final_evidence.nuisance)
    falls = not named or gap.falls
    if named and not falls:
        named, final, gap = False, first, gap_of(first, evidence.nuisance)
    tell("next experiment", 0.95)
    verdict, reason = verdict_of(selection, named, falls, gap)
    return Diagnosis(
        verdict=verdict,
        reason=reason,
        model=final.model,
        baseline=first.model,
        selection=selection,
        fit=final,
        where=where,
        gap=gap,
        next_experiment=decide(selection, evidence),
        experiment=experiment.noting(*beyond_reach([records[i] for i in usable])),
    )


def _quieted(experiment: Experiment, noise: Array) -> Experiment:
    size = f"{noise.max():.2g} V of noise"
    told = f"the voltage was measured with {size}; turns within {NOISE_WIDTH:g} times that are left out"
    records = tuple(quieted(r, n) for r, n in zip(experiment.records, noise.tolist(), strict=True))
    return replace(experiment, records=records).noting(Notice(VOLTAGE_NOISE, told))


def _finished(selection: Selection, evidence: Evidence, null: float) -> Fit:
    """The last fit, on all samples, begun anew behind new dynamics while that helps."""
    final = joint(selection.model, evidence, LAST, PRECISE)
    last = selection.accepted[-1].best
    while final.cost > NOISY * null:
        anew = restart(replace(last, effect=final.model[last.name], evidence=evidence, fit=final), LAST).fit
        if anew is None or anew.cost > WORTHWHILE * final.cost:
            break
        final = anew
    return final


def _undecided(experiment: Experiment, model: Model | None, severe: list[Notice]) -> Diagnosis:
    reason = f"No verdict: {severe[0].message}."
    return Diagnosis(Verdict.UNKNOWN, reason, model, model, None, None, (), None, None, experiment)
