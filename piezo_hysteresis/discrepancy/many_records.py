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

from dataclasses import replace

from ..errors import DivergenceError
from ..identification.fit.time_limit import ending_at
from ..identification.records.noise_floor import ADEQUATE
from ..model.model import Model
from .conclusion import concluded
from .diagnosis import Diagnosis
from .diagnosis_state import DiagnosisState
from .explicit_step import explicit_model, without_steps
from .localise import ResidualShare, located
from .search.baseline_setup import BaselineSetup, prepare_baseline
from .search.selection import select
from .search.selection_result import Selection
from .verdict import Conclusion

STEPS_LEAVE = 10.0
"""Largest cost after the subtraction of an explicit step, if it is subtracted before the search."""
EXPLICIT = (
    "No verdict is possible: the data were simulated with the explicit step of Eq. (7), which no real stage takes. "
    "Diagnose them with --explicit-step (Python: explicit_step=True)."
)
"""Reason if the error of the explicit step may not be subtracted."""


def diagnose_many(state: DiagnosisState) -> Diagnosis:
    """Fit the baseline, add the missing effects, and conclude.

    The error of an explicit step is subtracted if the user asked for it, otherwise the data have no verdict: before the
    search only if nothing else is missing, after it with the first effects with which the data show it. The search is
    repeated if time is left and the model that was found corrects averaged samples differently.
    """
    setup = _baseline(state)
    explicit = None
    if setup.score.excess > ADEQUATE:
        explicit = explicit_model(setup.baseline.model, setup.training_data, STEPS_LEAVE)
    selection = _search(state, setup) if explicit is None else None
    if selection is not None and selection.in_time:
        explicit = _explicit_model(selection)
    if explicit is not None:
        if not state.explicit_step:
            model, where = setup.baseline.model, _where(state, setup)
            return Diagnosis(Conclusion.INSUFFICIENT_DATA, EXPLICIT, model, model, state.experiment, where=where)
        state = replace(state, experiment=without_steps(state.experiment, explicit))
        setup, selection = _baseline(state), None
    selection = selection or _search(state, setup)
    extends = selection.in_time and selection.accepted and state.corrects_intersample_error
    if extends and setup.changes_intersample_error(selection.model):
        sharper = _baseline(state, selection)
        again = _search(state, sharper)
        setup, selection = (sharper, again) if again.in_time else (setup, selection)
    return concluded(state.experiment, setup, _where(state, setup), selection, state.progress, state.model)


def _baseline(state: DiagnosisState, known: Selection | None = None) -> BaselineSetup:
    """Floors, test records, and the published model fitted to the others."""
    corrects, progress = state.corrects_intersample_error, state.progress
    return prepare_baseline(state.experiment.records, state.usable, state.model, known, corrects, progress)


def _search(state: DiagnosisState, setup: BaselineSetup) -> Selection:
    model, training_data = setup.baseline.model, setup.training_data

    def progress(word: str, part: float) -> None:
        state.progress(word, 0.4 + 0.4 * part)

    with ending_at(state.end):
        return select(model, training_data, setup.score, state.effects, progress)


def _explicit_model(selection: Selection) -> Model | None:
    """Model of data with explicit steps, from the first effects with which the data show them."""
    for best in (s.best for s in selection.accepted if s.best.score.excess > ADEQUATE):
        explicit = explicit_model(best.fit.model, best.training_data)
        if explicit is not None:
            return explicit
    return None


def _where(state: DiagnosisState, setup: BaselineSetup) -> tuple[ResidualShare, ...]:
    state.progress("location of the residual", 0.82)
    model, least = setup.baseline.model, setup.least.tolist()
    try:
        return located(model, setup.records, setup.usable, least)
    except DivergenceError:  # on a test record, which moves further than those that were fitted
        return located(model, setup.records, setup.fitted, least)
