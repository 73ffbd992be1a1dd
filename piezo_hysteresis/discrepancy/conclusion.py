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

"""From the search to the answer: the last fits, the gap on the test records, and the next experiment."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace

from ..errors import DivergenceError
from ..identification.fit.fit import Fit, Progress
from ..identification.fit.form_uncertainty import with_form_uncertainty
from ..identification.records.excitation_check import missing_excitation
from ..model.model import Model
from ..record import Experiment
from .choice.next_experiment import best_next_experiment
from .diagnosis import Diagnosis
from .gap import Gap, measure_gap
from .localise import ResidualShare
from .search.baseline_setup import BaselineSetup
from .search.refit import LAST, PRECISE, TOLERANCE, joint, restart
from .search.selection_result import Selection
from .search.training_data import TrainingData
from .unnamed.offer import best_correction
from .verdict import Conclusion, Verdict, is_explained, named_conclusion, unnamed_conclusion

NOISY, WORTHWHILE = 1.1, 0.95
"""Ratio of the cost to the cost of noise above which the last fit is restarted, and largest ratio of the new cost to
the old one for which the new fit is kept and tested again."""
DIVERGES = (
    "No effect is named: the model without further effects diverges on a test record, which may move further than the "
    "records that were fitted. The gap is that of the fitted records."
)
"""Reason of the answer if there is no error on the test records."""


def concluded(
    experiment: Experiment,
    setup: BaselineSetup,
    where: tuple[ResidualShare, ...],
    selection: Selection,
    progress: Progress,
    given: Model | None,
) -> Diagnosis:
    """The last fits, the gap on the test records, the verdict, and the next experiment.

    `where` is the distribution of the residual of the baseline. The gap before is the own error of a `given` model, not
    that after a joint fit. It stays the model where no effect is named and the joint fit predicts the test records
    worse.
    """
    progress("gap", 0.85)
    whole, noise = setup.for_last_fit()
    named = is_explained(selection)
    first = joint(selection.baseline, whole, LAST, TOLERANCE if named else PRECISE)

    def gap_of(before: Model, after: Model, chosen: Sequence[int], *, offset: bool = False) -> Gap:
        unseen = chosen is setup.test_records
        both, least = (before, after), setup.least.tolist()
        return measure_gap(both, setup.records, chosen, least, setup.span, unseen=unseen, offset=offset)

    tested = setup.test_records or setup.fitted
    falls = diverges = False
    if named:
        final = _finished(selection, whole)
        with suppress(DivergenceError):  # on a test record, which moves further than those that were fitted
            gap = gap_of(first.model, final.model, tested)
            falls = gap.falls
    if not falls:
        final = first
        try:
            gap = gap_of(first.model, first.model, tested)
        except DivergenceError:
            tested, diverges = setup.fitted, True
            gap = gap_of(first.model, first.model, tested)
    free = whole.free_with(final.model)
    final = with_form_uncertainty(final, whole.records, free, whole.floors, noise, setup.span)
    progress("next experiment", 0.95)
    if diverges:
        said = Conclusion.INSUFFICIENT_DATA, DIVERGES
    elif not falls:
        said = unnamed_conclusion(selection, not named, gap)
    delivered = final.stated_model
    fit: Fit | None = final
    if given is not None:
        with suppress(DivergenceError):
            gap = gap_of(given, delivered, tested, offset=True)
            if not falls and gap.after > gap.before:  # a refit that names nothing must not predict worse
                delivered, fit = given, None
                gap = gap_of(given, given, tested, offset=True)
    if falls:
        said = named_conclusion(selection, gap)
    is_unexplained = said[0].verdict is Verdict.UNKNOWN and selection.in_time and not diverges
    found = {s.best.effect.public_name() for s in selection.accepted} if falls else set()
    missing = missing_excitation(setup.records, setup.usable, found)
    models = first.stated_model if given is None else given, delivered
    noted, everywhere = experiment.noting(*missing), None
    if delivered is not given and len(tested) < len(setup.usable):
        with suppress(DivergenceError):
            everywhere = gap_of(delivered, delivered, setup.usable, offset=given is not None)
    answer = answered(noted, said, models, given, fit, (gap, everywhere), selection, setup.training_data, where)
    return replace(answer, correction=best_correction(final.model, setup, experiment)) if is_unexplained else answer


def answered(
    experiment: Experiment,
    said: tuple[Conclusion, str],
    models: tuple[Model, Model],
    given: Model | None,
    fit: Fit | None,
    gaps: tuple[Gap, Gap | None],
    selection: Selection,
    training_data: TrainingData,
    where: tuple[ResidualShare, ...],
) -> Diagnosis:
    """The answer of a search, with the next experiment.

    `said` is the conclusion and its reason. The model after states this experiment as its origin, and its errors on it,
    unless it is the `given` one. `gaps` are the gap, and that on all records if it was measured on some of them.
    """
    conclusion, reason = said
    gap, everywhere = gaps
    before, after = models
    return Diagnosis(
        conclusion=conclusion,
        reason=reason,
        model=after if after is given else gap.stated_by(after, experiment, everywhere),
        baseline=before,
        selection=selection,
        fit=fit,
        where=where,
        gap=gap,
        next_experiment=best_next_experiment(selection, training_data),
        experiment=experiment,
    )


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
