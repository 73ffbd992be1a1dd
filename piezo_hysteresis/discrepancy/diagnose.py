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
from .changes.same_stage import same_stage
from .diagnosis import Diagnosis, Verdict
from .excitation_check import missing_excitation
from .form_uncertainty import with_form_uncertainty
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
    with np.errstate(over="ignore", invalid="ignore"):  # diverging trials show in their cost
        return _diagnosed(experiment, model, effects, progress or (lambda word, fraction: None))


def _diagnosed(
    experiment: Experiment,
    model: Model | None,
    effects: Collection[type[Effect]],
    progress: Progress,
    known: Selection | None = None,
) -> Diagnosis:
    """The diagnosis; `known` is an earlier search.

    Its model corrects averaged samples better than the baseline does.
    """
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
    if model is not None and known is None:
        progress("changes of the given model", 0.0)
        if (changed := same_stage(experiment, model, moving)) is not None:
            return changed
    if len(moving) < FEWEST:
        return diagnose_few(experiment, model, moving, effects, progress)

    notice_kinds = {n.kind for n in experiment.notices}
    sharpens, may_be_stepped = VOLTAGE_NOISE not in notice_kinds, KIND not in notice_kinds
    baseline_setup = prepare_baseline(experiment.records, usable, model, known, sharpens, progress)
    baseline = baseline_setup.baseline.model
    found_wanting = baseline_setup.score.excess > ADEQUATE
    if found_wanting and may_be_stepped and is_stepped(baseline, baseline_setup.training_data, leaves=STEPS_LEAVE):
        return _diagnosed(without_steps(experiment, baseline), model, effects, progress)
    where = _where(baseline_setup, progress)
    stepped = False

    def gains_nothing(model: Model, training_data: TrainingData) -> bool:
        nonlocal stepped
        stepped = may_be_stepped and is_stepped(model, training_data)
        return stepped

    selection = select(
        baseline,
        baseline_setup.training_data,
        baseline_setup.score,
        baseline_setup.null,
        effects,
        lambda word, part: progress(word, 0.4 + 0.4 * part),
        gains_nothing,
    )
    if stepped:
        return _diagnosed(without_steps(experiment, selection.model), model, effects, progress)
    leaves_a_gap = bool(selection.accepted) and selection.score.excess > ADEQUATE
    if leaves_a_gap and sharpens and known is None and baseline_setup.is_coarse(selection.model):
        return _diagnosed(experiment, model, effects, progress, selection)
    return _concluded(experiment, baseline_setup, where, selection, progress)


def _where(baseline_setup: BaselineSetup, progress: Progress) -> tuple[ResidualShare, ...]:
    progress("where", 0.35)
    left = residuals(baseline_setup.baseline.model, baseline_setup.records, baseline_setup.training_data.nuisance)
    usable = baseline_setup.usable
    return localise(
        [baseline_setup.records[i] for i in usable],
        [left[i] for i in usable],
        [baseline_setup.least[i] for i in usable],
    )


def _concluded(
    experiment: Experiment,
    baseline_setup: BaselineSetup,
    where: tuple[ResidualShare, ...],
    selection: Selection,
    progress: Progress,
) -> Diagnosis:
    """The last fits, the gap on records set aside, and what follows."""
    records, least, training_data = baseline_setup.records, baseline_setup.least, baseline_setup.training_data
    progress("gap", 0.85)
    named = is_explained(selection) and not is_makeshift(selection)
    whole = baseline_setup.whole
    plain = selection.baseline if selection.accepted else selection.model  # the search may have found better dynamics
    first = joint(plain, replace(training_data, records=whole), LAST, PRECISE)
    final_training_data = selection.accepted[-1].best.training_data if named else training_data
    final = _finished(selection, replace(final_training_data, records=whole), baseline_setup.null) if named else first
    chosen = baseline_setup.test_records or tuple(baseline_setup.fitted)

    def gap_of(last: Fit, nuisance: Nuisance) -> Gap:
        models, nuisances = (first.model, last.model), (training_data.nuisance, nuisance)
        return measure_gap(
            models, records, chosen, least.tolist(), baseline_setup.span, nuisances, bool(baseline_setup.test_records)
        )

    gap = gap_of(final, final_training_data.nuisance)
    falls = not named or gap.falls
    if named and not falls:
        named, final, final_training_data = False, first, training_data
        gap = gap_of(first, training_data.nuisance)
    fitted = replace(final_training_data, records=whole)
    final = with_form_uncertainty(final, fitted, baseline_setup.whole_noise, baseline_setup.span)
    progress("next experiment", 0.95)
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
        next_experiment=decide(selection, training_data),
        experiment=experiment.noting(*missing_excitation([records[i] for i in baseline_setup.usable])),
    )


def _quieted(experiment: Experiment, noise: Array) -> Experiment:
    size = f"{noise.max():.2g} V of noise"
    notice_kinds = (
        f"the voltage was measured with {size}; voltage changes smaller than {NOISE_WIDTH:g} times "
        "that were treated as noise"
    )
    records = tuple(quieted(r, n) for r, n in zip(experiment.records, noise.tolist(), strict=True))
    return replace(experiment, records=records).noting(Notice(VOLTAGE_NOISE, notice_kinds))


def _finished(selection: Selection, training_data: TrainingData, null: float) -> Fit:
    """The last fit, on all samples, begun anew behind new dynamics while that helps."""
    final = joint(selection.model, training_data, LAST, PRECISE)
    last = selection.accepted[-1].best
    while final.cost > NOISY * null:
        anew = restart(replace(last, effect=final.model[last.name], training_data=training_data, fit=final), LAST).fit
        if anew.cost > WORTHWHILE * final.cost:
            break
        final = anew
    return final


def _undecided(experiment: Experiment, model: Model | None, severe: list[Notice]) -> Diagnosis:
    reason = f"No verdict is possible, because of the data: {severe[0].message}."
    return Diagnosis(Verdict.UNKNOWN, reason, model, model, None, None, (), None, None, experiment)
