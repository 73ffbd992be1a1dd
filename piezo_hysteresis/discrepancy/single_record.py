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

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace

import numpy as np

from ..effects import ExtraResonance
from ..errors import DivergenceError, PiezoError
from ..identification.cores import start_helpers
from ..identification.fit.fit import Fit
from ..identification.fit.time_limit import TimeSpentError, ending_at
from ..identification.identification import Identification
from ..identification.identify import identify
from ..identification.left_out import has_several_drives, score_left_out
from ..identification.records.conditioning import with_conditioning
from ..identification.records.excitation_check import missing_excitation
from ..identification.records.noise_floor import ADEQUATE, floors, noise_floors, noise_of_averages
from ..identification.records.roles import roles_of
from ..identification.records.sampling import shortened
from ..identification.start_models import as_conditioning, with_zero
from ..identification.structure.structure_choice import LEADS
from ..identification.training.adjusted_numbers import loop_is_off
from ..identification.training.joint_fit import LAST, joint
from ..identification.training.model_score import score_model
from ..identification.training.training_data import choose_test_records, training_data_of
from ..model.model import Model
from .choice.next_experiment import best_next_experiment
from .diagnosis import Diagnosis
from .diagnosis_state import DiagnosisState
from .gap import gap_between
from .localise import located
from .search.baseline_setup import BaselineSetup
from .search.selection import select
from .search.selection_result import Selection, Step
from .search.structure_steps import structure_steps
from .verdict import CHOSEN, FEWEST_RECORDS, KEPT, REFITTED, Conclusion, conclusion_of_few

SHARP = 1e-6
"""Relative decrease of the cost at convergence of the baseline: few records take little time."""
SEARCHED = 20_000
"""Number of samples of a slow record in the search."""
EXTENDS = 0.1
"""Gain on rates, amplitudes and records left out (mean ln R²) from which an extended model is saved."""
ONLY_A_LAG = (
    " Without a broadband record, the dynamics of the published model are only a lag, so that this resonance may be "
    "the only one of the stage."
)
"""What is said of a resonance that the dynamics of the published model could contain."""


def diagnose_few(state: DiagnosisState) -> Diagnosis:
    """Extend the best model while cross-validation improves, and name the effects that are certain."""
    given, experiment = state.model, state.experiment
    setup, model, found, steps = _start(state)
    state.progress("location of the residual", 0.5)
    where = located(setup.baseline.model, setup.records, setup.fitted, setup.least, offset=True)
    selection, fit, is_certain = _extended(state, setup, model, found, steps)
    state.progress("gap", 0.9)
    first, final = given or setup.baseline.model, selection.model  # the gap of a given model is that before any refit
    gap = gap_between(first, final, setup, setup.tested, offset=True)
    if given is not None:
        with suppress(DivergenceError):
            fitted = gap_between(setup.baseline.stated_model, final, setup, setup.tested, offset=True)
            gap = replace(gap, refitted=fitted)
    shown = {s.best.effect.public_name() for s in selection.accepted}
    missing = missing_excitation(setup.records, setup.usable, shown)
    origin = CHOSEN if found else KEPT if fit is None else REFITTED
    several = has_several_drives(setup.records, setup.fitted)
    said = conclusion_of_few(selection, is_certain, setup.score, gap, len(setup.usable), several, missing, origin)
    if said[0] is Conclusion.MISSING_EFFECT and given is None and ExtraResonance.name in shown:
        said = said[0], said[1] + ("" if roles_of(experiment).broadband else ONLY_A_LAG)
    noted = experiment.noting(*missing)
    return Diagnosis(
        *said,
        model=given if final is given else gap.stated_by(final, noted, setup),
        baseline=first,
        experiment=noted,
        selection=selection,
        fit=fit,
        where=where,
        gap=gap,
        next_experiment=best_next_experiment(selection, setup.training_data),
    )


def _start(state: DiagnosisState) -> tuple[BaselineSetup, Model, Identification | None, list[Step]]:
    """The published or the given model, fitted jointly in the setup; the model to extend; and where it comes from.

    The model to extend has the structure that predicts best, unless a model was given or the time was over before. The
    steps are the effects of this structure that are certain.
    """
    experiment, used, progress = state.experiment, state.moving, state.progress
    records = experiment.records
    aside = choose_test_records(records, used) if len(used) >= FEWEST_RECORDS else ()
    fitted = [i for i in used if i not in aside]
    progress("baseline", 0.1)
    published, found = state.model, None
    if published is None:  # which records are not fitted was decided above
        known = as_conditioning(experiment, aside)
        published = identify(known, held_out=(), progress=lambda word, part: progress(word, 0.1 + 0.1 * part)).model
        with suppress(TimeSpentError), ending_at(state.end):
            found = identify(known, held_out=(), memory=True, progress=lambda w, f: progress(w, 0.2 + 0.3 * f))
    model, noise = found.model if found else published, noise_floors(records)
    short = shortened(records, SEARCHED)
    quiet = noise_of_averages(noise, records, short)
    least = floors(short, quiet)
    data = training_data_of(short, fitted, quiet, least, model)
    baseline = joint(with_zero(published), data, LAST, SHARP)
    score, lost = score_model(baseline.model, data, baseline.linearised), [np.zeros(r.size) for r in records]
    whole, span = floors(records, noise), experiment.range
    steps = list[Step]()
    if score.excess > ADEQUATE:
        start_helpers()  # effects will be searched for
        if found and has_several_drives(records, fitted):
            steps = structure_steps(found, score, data, short, least.tolist(), fitted)
    setup = BaselineSetup(records, records, lost, noise, whole, span, used, fitted, aside, data, baseline, score)
    return setup, model, found, steps


def _extended(
    state: DiagnosisState, setup: BaselineSetup, model: Model, found: Identification | None, steps: list[Step]
) -> tuple[Selection, Fit | None, bool]:
    """The effects of the structure and further ones, the fit of the saved model, and whether the structure is certain.

    There is no fit if a given model is saved.
    """
    data = setup.training_data
    now, score = (found.fit, score_model(model, data)) if found else (setup.baseline, setup.score)
    is_certain = bool(steps)
    fitting = [e for e in state.effects if not (loop_is_off(now.model) and e.host == now.model.hysteresis.name)]
    with ending_at(state.end):
        more = select(now.model, data, score, fitting, lambda w, f: state.progress(w, 0.6 + 0.3 * f))
    extended = more.accepted[-1].best.fit if more.accepted else None
    contenders = [] if found else [now]
    enough = len(setup.usable) >= FEWEST_RECORDS
    if extended is not None and (enough or not is_certain):  # few records show no effect beside a certain one
        contenders.append(extended)
    best = _best(setup, model, found, contenders, LEADS if is_certain else EXTENDS)
    if best is not None and best is extended:
        steps, score = [*steps, *more.steps], more.score
    else:
        steps += [replace(s, accepted=False) for s in more.steps]
    final = model if best is None else best.stated_model
    in_time = more.in_time and (found is not None or state.model is not None)
    selection = Selection(setup.baseline.model, final, score, tuple(steps), more.null, in_time)
    return selection, best or (found.fit if found else None), is_certain


def _best(
    setup: BaselineSetup, model: Model, found: Identification | None, contenders: Sequence[Fit], lead: float
) -> Fit | None:
    """The fit that predicts rates, amplitudes and records left out best, by `lead`; None if the model stays.

    A model that diverges on a test record is not taken.
    """
    best = None
    judged = setup.records, setup.least, setup.fitted
    reached = score_left_out(model, *judged, adjusts=found is not None) if contenders else 0.0
    for contender in contenders:
        extended = contender.stated_model
        with suppress(PiezoError):
            score = score_left_out(extended, *judged)
            extended.free_run([setup.records[i] for i in with_conditioning(setup.records, setup.tested)])
            if score < reached - lead:
                best, reached = contender, score
    return best
