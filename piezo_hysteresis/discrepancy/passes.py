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

"""The passes of a diagnosis: each takes the state of the diagnosis, and returns the new state or the final answer."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..errors import DivergenceError, IdentificationError
from ..identification.fit.fit import Progress
from ..identification.records.conditioning_split import known_from_within
from ..identification.records.roles import roles_of
from ..model.model import Model
from ..record import Notice
from .changes.same_stage import same_stage
from .conclusion import concluded
from .diagnosis import Conclusion, Diagnosis
from .diagnosis_state import VOLTAGE_NOISE, DiagnosisState
from .excitation_check import check_motion, moves
from .explicit_step import KIND, explicit_model, without_steps
from .single_record import diagnose_few
from .residual.localise import ResidualShare, located
from .residual.sampling import NOISE_WIDTH, is_faster, quieted, resampled, voltage_noise
from .search.baseline_setup import BaselineSetup, prepare_baseline
from .search.cross_validation import ADEQUATE
from .search.execution.time_limit import ending_at
from .search.selection import select
from .unnamed.correction import without_corrections
from .verdict import FEWEST_RECORDS

Array = NDArray[np.float64]

STEPS_LEAVE = 10.0
"""Largest cost after the subtraction of an explicit step, if it is subtracted before the search."""

RESAMPLED = "resampled"
"""Kind of the notice about records that are faster than the given model."""

Pass = Callable[[DiagnosisState], DiagnosisState | Diagnosis]
"""Takes the state of the diagnosis; returns the new state, or the answer, which ends the diagnosis."""


def quiet_voltage(state: DiagnosisState) -> DiagnosisState:
    """Remove changes of the voltage that are not larger than its measured noise."""
    experiment = state.experiment
    noise = voltage_noise(experiment.records)
    if not noise.any():
        return state
    message = (
        f"the voltage was measured with {noise.max():.2g} V of noise; voltage changes smaller than "
        f"{NOISE_WIDTH:g} times that were treated as noise"
    )
    records = tuple(quieted(r, n) for r, n in zip(experiment.records, noise.tolist(), strict=True))
    return replace(state, experiment=replace(experiment, records=records).noting(Notice(VOLTAGE_NOISE, message)))


def start_at_a_known_state(state: DiagnosisState) -> DiagnosisState:
    """Cut records that begin in an unknown state at the point where a full loop determines it, as `identify` does."""
    experiment, notices = known_from_within(state.experiment)
    return replace(state, experiment=experiment.noting(*notices)) if notices else state


def check_data(state: DiagnosisState) -> DiagnosisState | Diagnosis:
    """Ends with "unknown" if the data are damaged.

    Raises
    ------
    IdentificationError
        If the drive does not move in any record that is compared with a model, or the displacement is constant.
    """
    experiment, model = state.experiment, state.model
    if not any(moves(record) for record in experiment):
        raise IdentificationError("diagnose: the drive does not move in any record; expected loops, steps or noise")
    severe = [n for n in experiment.notices if n.severe]
    if not severe:
        check_motion("diagnose", [experiment[i] for i in state.moving])
        return state
    reason = f"No verdict is possible, because of the data: {severe[0].message}."
    return Diagnosis(Conclusion.INSUFFICIENT_DATA, reason, model, model, experiment)


def resample_for_the_given_model(state: DiagnosisState) -> DiagnosisState:
    """Convert records that are faster than the given model, which holds at its sample period and at longer ones."""
    if state.model is None:
        return state
    period, experiment = state.model.sample_period, state.experiment
    fast = [r.sample_period for r in experiment if is_faster(r, period)]
    if not fast:
        return state
    message = (
        f"the given model holds from a sample period of {period:g} s on; "
        f"records with samples every {min(fast):g} s were converted to it"
    )
    records = tuple(resampled(r, period) if is_faster(r, period) else r for r in experiment.records)
    return replace(state, experiment=replace(experiment, records=records).noting(Notice(RESAMPLED, message)))


def compare_with_given_model(state: DiagnosisState) -> DiagnosisState | Diagnosis:
    """Ends with the changed parameter if the given model explains the records apart from this change."""
    model = state.model
    if model is None:
        return state
    found = same_stage(
        state.experiment,
        model,
        state.moving,
        lambda part: state.progress("changes of the given model", 0.1 * part),
        state.given,
    )
    if isinstance(found, Notice):
        state, found = replace(state, experiment=state.experiment.noting(found)), None
    return found or replace(state, model=without_corrections(model))


def answer_few_records(state: DiagnosisState) -> DiagnosisState | Diagnosis:
    """Ends if there are few records or none is broadband: the answer follows from the chosen structure."""
    needs_structure = state.model is None and not roles_of(state.experiment).broadband
    if len(state.moving) >= FEWEST_RECORDS and not needs_structure:
        return state
    return diagnose_few(state.experiment, state.model, state.moving, state.effects, state.progress, state.end)


def fit_baseline(state: DiagnosisState) -> DiagnosisState:
    """Estimates the floors, chooses the test records, and fits the published model to the others."""
    setup = prepare_baseline(
        state.experiment.records,
        state.usable,
        state.model,
        state.selection,
        state.corrects_intersample_error,
        state.progress,
    )
    return replace(state, setup=setup, where=_where(setup, state.progress), selection=None)


def search_effects(state: DiagnosisState) -> DiagnosisState:
    """Adds effects to the baseline while cross-validation improves."""
    setup = state.fitted
    with ending_at(state.end):
        selection = select(
            setup.baseline.model,
            setup.training_data,
            setup.score,
            state.effects,
            lambda word, part: state.progress(word, 0.4 + 0.4 * part),
        )
    return replace(state, selection=selection)


def search_again_with_sharper_samples(state: DiagnosisState) -> DiagnosisState:
    """Searches once more, if time is left and the model that was found corrects averaged samples differently."""
    selection = state.searched
    extends = selection.in_time and bool(selection.accepted)
    if not (extends and state.corrects_intersample_error and state.fitted.changes_intersample_error(selection.model)):
        return state
    again = search_effects(fit_baseline(state))
    return again if again.searched.in_time else state


def treat_explicit_steps(state: DiagnosisState) -> DiagnosisState | Diagnosis:
    """Data of a simulation with an explicit step of the loop: subtract its error if the user asked for it, or end.

    Before the search only if nothing else is missing; after it with the first effects with which the data show it.
    """
    setup, selection = state.fitted, state.selection
    training_data, model = setup.training_data, setup.baseline.model
    if any(n.kind == KIND for n in state.experiment.notices) or setup.score.excess <= ADEQUATE:
        return state
    if selection is None:
        explicit = explicit_model(model, training_data, STEPS_LEAVE)
        return state if explicit is None else _freed(state, explicit)
    for step in (s.best for s in selection.accepted if selection.in_time):
        leaves_a_gap = step.score.excess > ADEQUATE
        explicit = explicit_model(step.fit.model, step.training_data) if leaves_a_gap else None
        if explicit is not None:
            freed = _freed(state, explicit)
            return freed if isinstance(freed, Diagnosis) else search_effects(freed)
    return state


def _freed(state: DiagnosisState, explicit: Model) -> DiagnosisState | Diagnosis:
    if state.explicit_step:
        freed = without_steps(state.experiment, explicit)
        return fit_baseline(replace(state, experiment=freed, selection=None))
    reason = (
        "No verdict is possible: the data were simulated with the explicit step of Eq. (7), which no real stage takes. "
        "Diagnose them with --explicit-step (Python: explicit_step=True)."
    )
    model = state.fitted.baseline.model
    return Diagnosis(Conclusion.INSUFFICIENT_DATA, reason, model, model, state.experiment, where=state.where)


def conclude(state: DiagnosisState) -> Diagnosis:
    """Ends with the last fits, the gap on the test records, and the verdict."""
    return concluded(state.experiment, state.fitted, state.where, state.searched, state.progress, state.model)


PASSES: tuple[Pass, ...] = (
    quiet_voltage,
    start_at_a_known_state,
    check_data,
    resample_for_the_given_model,
    compare_with_given_model,
    answer_few_records,
    fit_baseline,
    treat_explicit_steps,
    search_effects,
    treat_explicit_steps,
    search_again_with_sharper_samples,
    conclude,
)
"""The diagnosis, in the order in which the passes run."""


def _where(setup: BaselineSetup, progress: Progress) -> tuple[ResidualShare, ...]:
    progress("location of the residual", 0.35)
    model, least, nuisance = setup.baseline.model, setup.least.tolist(), setup.training_data.nuisance
    try:
        return located(model, setup.records, setup.usable, least, nuisance)
    except DivergenceError:  # on a test record, which moves further than those that were fitted
        return located(model, setup.records, setup.fitted, least, nuisance)
