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

"""Diagnosis of few records, or of records without a broadband one: from the best model that `identify` finds.

The published model remains the baseline of the gap. The search begins with the structure that predicts best in
cross-validation, and the saved model is at least as good. Effects that this structure needs to predict other rates and
amplitudes are named.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from contextlib import suppress
from dataclasses import replace

from ..effects import ExtraResonance
from ..errors import PiezoError
from ..identification.cores import start_helpers
from ..identification.fit.cross_validation import Score
from ..identification.fit.fit import Fit
from ..identification.fit.time_limit import TimeSpentError, ending_at
from ..identification.identify import identify
from ..identification.records.conditioning import with_conditioning
from ..identification.records.excitation_check import missing_excitation
from ..identification.records.noise_floor import ADEQUATE, floors, noise_floors, noise_of_averages
from ..identification.records.roles import roles_of
from ..identification.records.sampling import shortened
from ..identification.start_models import as_conditioning
from ..identification.structure.left_out import has_several_drives, score_left_out
from ..identification.structure.structure_choice import LEADS
from ..model.model import Model
from ..record import Notice, Record
from .choice.next_experiment import best_next_experiment
from .diagnosis import Diagnosis
from .diagnosis_state import DiagnosisState
from .gap import Gap, measure_gap
from .localise import located
from .search.baseline_setup import with_zero
from .search.candidates import loop_is_off, score_model
from .search.refit import LAST, joint
from .search.selection import select
from .search.selection_result import Selection, Step
from .search.structure_steps import structure_steps
from .search.training_data import choose_test_records, training_data_of
from .verdict import FEWEST_RECORDS, MORE_MAY_BE_MISSING, Conclusion, is_explained, named_conclusion, unnamed_conclusion

SHARP = 1e-6
"""Relative decrease of the cost at convergence of the baseline: few records take little time."""
SEARCHED = 20_000
"""Number of samples of a slow record in the search."""
EXTENDS = 0.1
"""Gain on rates, amplitudes and records left out (mean ln R²) from which an extended model is saved."""
CHOSEN = (
    "the saved model has the structure that predicts best in cross-validation; it explains {} of the gap of the "
    "published model"
)
"""What is said of the saved model without a further effect, if no model was given."""
REFITTED = "the saved model is the given one, fitted to these records; it explains {} of the gap of the given model"
"""The same, if a refit of the given model is saved."""
KEPT = "the given model is saved unchanged, because a fit to these records predicts what was left out hardly better"
"""The same, if the given model is saved."""

ONLY_A_LAG = (
    " Without a broadband record, the dynamics of the published model are only a lag, so that this resonance may be "
    "the only one of the stage."
)
"""What is said of a resonance that the dynamics of the published model could contain."""


def diagnose_few(state: DiagnosisState) -> Diagnosis:
    """Extend the best model while cross-validation improves, and name the effects that are certain.

    Without a given model, one is identified from the prepared records.
    """
    experiment, model, used, progress = state.experiment, state.model, state.moving, state.progress
    records = experiment.records
    aside = choose_test_records(records, used) if len(used) >= FEWEST_RECORDS else ()
    fitted = [i for i in used if i not in aside]
    known = as_conditioning(experiment, aside)
    progress("baseline", 0.1)
    published, found, in_time = model, None, True
    if published is None:  # which records are not fitted was decided above
        published = identify(known, held_out=(), progress=lambda word, part: progress(word, 0.1 + 0.1 * part)).model
        try:
            with ending_at(state.end):
                found = identify(known, held_out=(), memory=True, progress=lambda w, f: progress(w, 0.2 + 0.3 * f))
        except TimeSpentError:
            in_time = False
    start = found.model if found else published
    noise, span = noise_floors(records), experiment.range
    least = floors(records, noise).tolist()
    short = shortened(records, SEARCHED)
    quiet = noise_of_averages(noise, records, short)
    short_least = floors(short, quiet)
    training_data = training_data_of(short, fitted, quiet, short_least, start)
    baseline = joint(with_zero(published), training_data, LAST, SHARP)
    before = score_model(baseline.model, training_data, baseline.linearised)
    if before.excess > ADEQUATE:
        start_helpers()  # effects will be searched for
    progress("location of the residual", 0.5)
    where = located(baseline.model, records, fitted, least, offset=True)

    steps: list[Step] = []
    now, score = (found.fit, score_model(start, training_data)) if found else (baseline, before)
    several = has_several_drives(records, fitted)
    if found and before.excess > ADEQUATE and several:
        steps = structure_steps(found, before, training_data, short, short_least.tolist(), fitted)
    is_certain = bool(steps)
    fitting = [e for e in state.effects if not (loop_is_off(now.model) and e.host == now.model.hysteresis.name)]
    with ending_at(state.end):
        more = select(now.model, training_data, score, fitting, lambda word, part: progress(word, 0.6 + 0.3 * part))
    chosen = sorted(aside or fitted)
    contenders = [] if found else [now]
    enough = len(used) >= FEWEST_RECORDS and several
    if more.accepted and (enough or not is_certain):  # few records do not show an effect beside a certain one
        contenders.append(more.accepted[-1].best.fit)
    final, fit = start, found.fit if found else None
    lead = LEADS if is_certain else EXTENDS
    best = None
    if contenders:
        best = _best(start, fit is not None, contenders, records, least, fitted, chosen, lead)
    if best is not None:
        final, fit = best.stated_model, best
    if more.accepted and best is more.accepted[-1].best.fit:
        steps, score = [*steps, *more.steps], more.score
    else:
        steps = [*steps, *(replace(s, accepted=False) for s in more.steps)]
    selection = Selection(baseline.model, final, score, tuple(steps), more.null, in_time and more.in_time)

    progress("gap", 0.9)
    first = model or baseline.model  # the gap of a given model is measured before any refit
    gap = measure_gap((first, final), records, chosen, least, span, unseen=bool(aside), offset=True)
    shown = {s.best.effect.public_name() for s in selection.accepted}
    missing = missing_excitation(records, used, shown)
    origin = CHOSEN if found else KEPT if fit is None else REFITTED
    said = conclusion_of_few(selection, is_certain, before, gap, len(used), several, missing, origin)
    if said[0] is Conclusion.MISSING_EFFECT and model is None and ExtraResonance.name in shown:
        said = said[0], said[1] + ("" if roles_of(experiment).broadband else ONLY_A_LAG)
    everywhere = None
    if aside and final is not model:
        everywhere = measure_gap((final, final), records, used, least, span, unseen=False, offset=True)
    noted = experiment.noting(*missing)
    return Diagnosis(
        *said,
        model=model if final is model else gap.stated_by(final, noted, everywhere),
        baseline=first,
        experiment=noted,
        selection=selection,
        fit=fit,
        where=where,
        gap=gap,
        next_experiment=best_next_experiment(selection, training_data),
    )


def _best(
    start: Model,
    adjusts: bool,
    contenders: Sequence[Fit],
    records: Sequence[Record],
    least: Sequence[float],
    fitted: Collection[int],
    tested: Sequence[int],
    lead: float,
) -> Fit | None:
    """The fit that predicts rates, amplitudes and records left out best, by `lead`; None if the start stays.

    A model that diverges on a test record is not taken. `adjusts` says whether the start was fitted to these records.
    """
    best: Fit | None = None
    reached = score_left_out(start, records, least, fitted, adjusts=adjusts)
    for contender in contenders:
        model = contender.stated_model
        with suppress(PiezoError):
            score = score_left_out(model, records, least, fitted)
            model.free_run([records[i] for i in with_conditioning(records, tested)])
            if score < reached - lead:
                best, reached = contender, score
    return best


def conclusion_of_few(
    selection: Selection,
    decided: bool,
    before: Score,
    gap: Gap,
    count: int,
    several: bool,
    missing: Sequence[Notice],
    origin: str = CHOSEN,
) -> tuple[Conclusion, str]:
    """The conclusion and its reason.

    A small error of the extended model is no evidence that nothing is missing in the published one. One rate and one
    amplitude can be explained by wrong effects. `origin` says which model is saved, if it contains no further effect.
    """
    named = gap.falls and (decided or (count >= FEWEST_RECORDS and several and is_explained(selection)))
    if not selection.in_time and not named:
        return unnamed_conclusion(selection, gap.falls, gap)
    closed = f"{100 * gap.explained:.0f} %"
    names = [s.best.effect.public_name() for s in selection.accepted]
    if named and not decided:
        return named_conclusion(selection, gap)
    if named:
        alike = [(s.best.effect.public_name(), s.confusable_with) for s in selection.accepted if s.confusable_with]
        said = (
            f"The model does not contain {' and '.join(names)}. An extended model predicts rates, amplitudes and "
            f"records better that were left out of the fit; it explains {closed} of the gap."
        )
        said += "".join(f" These data cannot distinguish {name} from {' or '.join(r)}." for name, r in alike)
        return Conclusion.MISSING_EFFECT, said + ("" if selection.in_time else MORE_MAY_BE_MISSING)
    is_adequate = before.excess <= ADEQUATE
    if count >= FEWEST_RECORDS and not decided and (several or is_adequate):
        judged = replace(gap, after=gap.before) if is_adequate else gap  # of the published model
        conclusion, reason = unnamed_conclusion(selection, gap.falls, judged)
        if is_adequate or conclusion is not Conclusion.NOTHING_MISSING:
            return conclusion, reason
    if is_adequate:
        which = "published model" if origin == CHOSEN else "given model, fitted to these records,"
        message = f"the error of the {which} is at the noise floor, so the data cannot show further effects"
    elif names:
        message = (
            f"the closest effect is {' with '.join(names)}, which was added to the model; "
            f"the saved model explains {closed} of the gap"
        )
    else:
        message = origin.format(closed)
    records = ("one record" if count == 1 else f"{count} records") + ("" if several else " of one rate and amplitude")
    reason = "; ".join(
        (f"No effect is named, because {records} cannot distinguish effects", message, *(n.message for n in missing))
    )
    return Conclusion.INSUFFICIENT_DATA, f"{reason}."
