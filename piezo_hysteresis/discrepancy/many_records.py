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

"""Diagnosis of many records: a baseline is fitted to them, and effects are added while cross-validation improves."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace

from ..errors import DivergenceError, PiezoError
from ..identification.fit.fit import Fit
from ..identification.fit.form_uncertainty import with_alternative, with_form_uncertainty
from ..identification.fit.time_limit import TimeSpentError, ending_at
from ..identification.identification import Identification
from ..identification.identify import identify
from ..identification.records.excitation_check import missing_excitation
from ..identification.records.noise_floor import ADEQUATE
from ..identification.start_models import as_conditioning
from ..identification.training.explicit_step import BETTER, explicit_model, without_steps
from ..identification.training.joint_fit import LAST, PRECISE, TOLERANCE, joint
from ..identification.training.training_data import TrainingData
from ..model.model import Model
from .choice.next_experiment import best_next_experiment
from .diagnosis import Diagnosis
from .diagnosis_state import DiagnosisState
from .gap import Gap, gap_between
from .localise import located
from .search.baseline_setup import BaselineSetup, prepare_baseline
from .search.refit import restart
from .search.selection import select
from .search.selection_result import Selection
from .unnamed.offer import REMOVES, best_correction
from .verdict import CHOSEN, Conclusion, Verdict, is_explained, named_conclusion, unnamed_conclusion

EXPLICIT = (
    "No verdict is possible: the data were simulated with the explicit step of Eq. (7), which no real stage takes. "
    "Diagnose them with --explicit-step (Python: explicit_step=True)."
)
"""Reason if the error of the explicit step may not be subtracted."""
NOISY, WORTHWHILE = 1.1, 0.95
"""Ratio of the cost to the cost of noise above which the last fit is restarted, and largest ratio of the new cost to
the old one for which the new fit is kept and tested again."""
DIVERGES = (
    "No effect is named: the model without further effects diverges on a test record, which may move further than the "
    "records that were fitted. The gap is that of the fitted records."
)
"""Reason of the answer if there is no error on the test records."""
CUT_SHORT = " The time limit ended the search for a structure or a correction that explains more."
"""Added to the reason of an unexplained gap if no time was left for what follows the search for effects."""


def diagnose_many(state: DiagnosisState) -> Diagnosis:
    """Fit the baseline, add the missing effects, and conclude.

    If the error of an explicit step describes the data about as well as the effects found, it is subtracted if the
    user asked for it; otherwise the data have no verdict. A loop that depends on speed leaves a similar error, so the
    two are compared with everything that is found beside them. The search is repeated if time is left and the model
    that was found corrects averaged samples differently, which that of a small error does not.
    """
    setup, selection = _searched(state)
    models = [setup.baseline.model] if setup.score.excess > ADEQUATE else []
    models += [s.best.fit.model for s in selection.accepted if selection.in_time and s.best.score.excess > ADEQUATE]
    for explicit in filter(None, (explicit_model(model, setup.training_data) for model in models)):
        freed = replace(state, experiment=without_steps(state.experiment, explicit))
        found = _searched(freed)
        if selection.score.excess < BETTER * found[1].score.excess:
            continue
        if not state.explicit_step:
            model = selection.baseline
            where = located(model, setup.records, setup.fitted, setup.least)
            return Diagnosis(Conclusion.INSUFFICIENT_DATA, EXPLICIT, model, model, state.experiment, where=where)
        state, (setup, selection) = freed, found
        break
    extends = setup.score.excess > ADEQUATE and selection.in_time and selection.accepted
    if extends and state.corrects_intersample_error and setup.changes_intersample_error(selection.model):
        sharper, again = _searched(state, selection)
        setup, selection = (sharper, again) if again.in_time else (setup, selection)
    return _concluded(state, setup, selection)


def _searched(state: DiagnosisState, known: Selection | None = None) -> tuple[BaselineSetup, Selection]:
    """The published model fitted to the training records, and the effects that a search adds to it."""
    corrects, progress = state.corrects_intersample_error, state.progress
    setup = prepare_baseline(state.experiment.records, state.usable, state.model, known, corrects, progress)
    model, data = setup.baseline.model, setup.training_data
    with ending_at(state.end):
        return setup, select(model, data, setup.score, state.effects, lambda w, f: progress(w, 0.4 + 0.4 * f))


def _concluded(state: DiagnosisState, setup: BaselineSetup, selection: Selection) -> Diagnosis:
    """The last fits, the gap on the test records, the verdict, and the next experiment.

    The gap before is the own error of a given model, not that after a joint fit. It stays the model where no effect is
    named and the joint fit predicts the test records worse.
    """
    state.progress("location of the residual", 0.82)
    where, given = located(selection.baseline, setup.records, setup.fitted, setup.least), state.model
    state.progress("gap", 0.85)
    whole, noise = setup.for_last_fit()
    named = is_explained(selection)
    first = joint(selection.baseline, whole, LAST, TOLERANCE if named else PRECISE)
    tested, falls, diverges = setup.tested, False, False
    if named:
        final = _finished(selection, whole)
        with suppress(DivergenceError):  # on a test record, which moves further than those that were fitted
            gap = gap_between(first.model, final.model, setup, tested)
            falls = gap.falls
    if not falls:
        final = first
        try:
            gap = gap_between(first.model, first.model, setup, tested)
        except DivergenceError:
            tested, diverges = setup.fitted, True
            gap = gap_between(first.model, first.model, setup, tested)
    free = whole.free_with(final.model)
    final = with_form_uncertainty(final, whole.records, free, whole.floors, noise, setup.span)
    if falls and (other := selection.alternative) is not None:
        final = with_alternative(final, selection.accepted[-1].best.fit, other.fit)
    state.progress("next experiment", 0.95)
    if diverges:
        said = Conclusion.INSUFFICIENT_DATA, DIVERGES
    elif not falls:
        said = unnamed_conclusion(selection, not named, gap)
    delivered = final.stated_model
    fit: Fit | None = final
    if given is not None:
        with suppress(DivergenceError):
            gap = gap_between(given, delivered, setup, tested, offset=True)
            if not falls and gap.after > gap.before:  # a refit that names nothing must not predict worse
                delivered, fit = given, None
                gap = gap_between(given, given, setup, tested, offset=True)
            if falls:
                gap = replace(gap, refitted=gap_between(first.stated_model, delivered, setup, tested, offset=True))
    if falls:
        said = named_conclusion(selection, gap)
    conclusion, reason = said
    is_unexplained = conclusion.verdict is Verdict.UNKNOWN and selection.in_time and not diverges
    structured = correction = None
    if is_unexplained:
        try:
            with ending_at(state.end):
                structured = _structured(state, setup, first.model) if given is None else None
                correction = None if structured else best_correction(final.model, setup, state.experiment)
        except TimeSpentError:
            reason += CUT_SHORT
    if structured is not None:
        identified, gap = structured
        fit, delivered = identified.fit, identified.model
        reason += f" {CHOSEN.format(f'{100 * gap.explained:.0f} %').capitalize()}."
    found = {s.best.effect.public_name() for s in selection.accepted} if falls else set()
    noted = state.experiment.noting(*missing_excitation(state.experiment.records, setup.usable, found))
    return Diagnosis(
        conclusion,
        reason,
        model=given if delivered is given else gap.stated_by(delivered, noted, setup),
        baseline=first.stated_model if given is None else given,
        experiment=noted,
        selection=selection,
        fit=fit,
        where=where,
        gap=gap,
        next_experiment=best_next_experiment(selection, setup.training_data) if falls or is_unexplained else None,
        correction=correction,
    )


def _structured(state: DiagnosisState, setup: BaselineSetup, published: Model) -> tuple[Identification, Gap] | None:
    """The model of `identify` and its gap, if it explains much of what the published model leaves; else None."""
    state.progress("structure", 0.9)
    known = as_conditioning(state.experiment, setup.test_records)
    with suppress(PiezoError):
        found = identify(known, held_out=(), memory=True)
        gap = gap_between(published, found.model, setup, setup.tested)
        return (found, gap) if found.structure is not None and gap.explained >= REMOVES else None
    return None


def _finished(selection: Selection, training_data: TrainingData) -> Fit:
    """The last fit of the named effects; restarted with newly estimated dynamics while this reduces the cost."""
    final = joint(selection.model, training_data, LAST, PRECISE)
    last = selection.accepted[-1].best
    while final.cost > NOISY * training_data.null:
        anew = restart(replace(last, effect=final.model[last.name], training_data=training_data, fit=final), LAST).fit
        if anew.cost > WORTHWHILE * final.cost:
            break
        final = anew
    return final
