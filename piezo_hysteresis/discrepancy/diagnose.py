"""`diagnose`: floor → where → candidates → add → gap → next experiment; each step a function of its own."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..effects import CATALOGUE, Effect
from ..errors import IdentificationError
from ..identification.fit.fit import Fit, Progress
from ..identification.fit.normal_equations import Nuisance, residuals
from ..identification.one_core import on_one_core
from ..identification.records.roles import CARRYING
from ..model.model import Model
from ..record import Experiment, Notice
from .diagnosis import Diagnosis, Verdict
from .excitation_check import missing_excitation
from .gap import Gap, measure_gap
from .next_experiment import decide
from .residual.explicit_step import KIND, is_stepped, without_steps
from .residual.localise import ResidualShare, localise
from .residual.sampling import NOISE_WIDTH, quieted, voltage_noise
from .search.baseline_setup import BaselineSetup, prepare_baseline
from .search.cross_validation import ADEQUATE
from .search.refit import LAST, PRECISE, joint, restart
from .search.selection import select
from .search.selection_result import Selection
from .search.single_record import diagnose_few
from .search.training_data import TrainingData
from .verdict import FEWEST, is_explained, is_makeshift, verdict_of

Array = NDArray[np.float64]

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
    usable = [i for i, r in enumerate(experiment) if r.phase not in IDLE and not r.truncated]
    moving = [i for i, r in enumerate(experiment) if np.ptp(np.append(r.voltage, r.settled_voltage)) > 0.0]
    if not moving:
        raise IdentificationError("diagnose: the drive does not move in any record; expected loops, steps or noise")
    if severe := [n for n in experiment.notices if n.severe]:
        return _undecided(experiment, model, severe)
    moving = [i for i in moving if i in usable]
    if len(moving) < FEWEST:
        return diagnose_few(experiment, model, moving, effects, tell)

    told = {n.kind for n in experiment.notices}
    sharpens, may_be_stepped = VOLTAGE_NOISE not in told, KIND not in told
    ground = prepare_baseline(experiment.records, usable, model, known, sharpens, tell)
    baseline = ground.baseline.model
    found_wanting = ground.score.excess > ADEQUATE
    if found_wanting and may_be_stepped and is_stepped(baseline, ground.evidence, leaves=STEPS_LEAVE):
        return _diagnosed(without_steps(experiment, baseline), model, effects, tell)
    where = _where(ground, tell)
    stepped = False

    def is_in_vain(model: Model, evidence: TrainingData) -> bool:
        nonlocal stepped
        stepped = may_be_stepped and is_stepped(model, evidence)
        return stepped

    selection = select(
        baseline,
        ground.evidence,
        ground.score,
        ground.null,
        effects,
        lambda word, part: tell(word, 0.4 + 0.4 * part),
        is_in_vain,
    )
    if stepped:
        return _diagnosed(without_steps(experiment, selection.model), model, effects, tell)
    leaves_a_gap = bool(selection.accepted) and selection.score.excess > ADEQUATE
    if leaves_a_gap and sharpens and known is None and ground.is_coarse(selection.model):
        return _diagnosed(experiment, model, effects, tell, selection)
    return _concluded(experiment, ground, where, selection, tell)


def _where(ground: BaselineSetup, tell: Progress) -> tuple[ResidualShare, ...]:
    tell("where", 0.35)
    left = residuals(ground.baseline.model, ground.records, ground.evidence.nuisance)
    usable = ground.usable
    return localise([ground.records[i] for i in usable], [left[i] for i in usable], [ground.least[i] for i in usable])


def _concluded(
    experiment: Experiment,
    ground: BaselineSetup,
    where: tuple[ResidualShare, ...],
    selection: Selection,
    tell: Progress,
) -> Diagnosis:
    """The last fits, the gap on records set aside, and what follows."""
    records, least, evidence = ground.records, ground.least, ground.evidence
    tell("gap", 0.85)
    named = is_explained(selection) and not is_makeshift(selection)
    whole = ground.whole
    plain = selection.baseline if selection.accepted else selection.model  # the search may have found better dynamics
    first = joint(plain, replace(evidence, records=whole), LAST, PRECISE)
    final_evidence = selection.accepted[-1].best.evidence if named else evidence
    final = _finished(selection, replace(final_evidence, records=whole), ground.null) if named else first
    chosen = ground.spared or tuple(ground.fitted)

    def gap_of(last: Fit, nuisance: Nuisance) -> Gap:
        models, nuisances = (first.model, last.model), (evidence.nuisance, nuisance)
        return measure_gap(models, records, chosen, least.tolist(), ground.span, nuisances, bool(ground.spared))

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
        experiment=experiment.noting(*missing_excitation([records[i] for i in ground.usable])),
    )


def _quieted(experiment: Experiment, noise: Array) -> Experiment:
    size = f"{noise.max():.2g} V of noise"
    told = f"the voltage was measured with {size}; turns within {NOISE_WIDTH:g} times that are left out"
    records = tuple(quieted(r, n) for r, n in zip(experiment.records, noise.tolist(), strict=True))
    return replace(experiment, records=records).noting(Notice(VOLTAGE_NOISE, told))


def _finished(selection: Selection, evidence: TrainingData, null: float) -> Fit:
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
