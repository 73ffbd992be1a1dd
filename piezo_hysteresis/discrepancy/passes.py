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

from ..errors import IdentificationError
from ..identification.records.comparable import comparable
from ..identification.records.roles import roles_of
from ..record import Notice
from .changes.same_stage import same_stage
from .diagnosis import Diagnosis
from .diagnosis_state import DiagnosisState
from .excitation_check import check_motion, moves
from .many_records import diagnose_many
from .residual.sampling import is_faster, resampled
from .single_record import diagnose_few
from .unnamed.correction import without_corrections
from .verdict import FEWEST_RECORDS, Conclusion

RESAMPLED = "resampled"
"""Kind of the notice about records that are faster than the given model."""

Pass = Callable[[DiagnosisState], DiagnosisState | Diagnosis]
"""Takes the state of the diagnosis; returns the new state, or the answer, which ends the diagnosis."""


def prepare(state: DiagnosisState) -> DiagnosisState:
    """Remove the noise of a measured voltage, and cut records that begin in an unknown state, as `identify` does."""
    experiment, notices = comparable(state.experiment)
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


def answer(state: DiagnosisState) -> Diagnosis:
    """The answer, for few records from the chosen structure: with fewer than four, or if none is broadband."""
    needs_structure = state.model is None and not roles_of(state.experiment).broadband
    is_many = len(state.moving) >= FEWEST_RECORDS and not needs_structure
    return diagnose_many(state) if is_many else diagnose_few(state)


PASSES: tuple[Pass, ...] = (
    prepare,
    check_data,
    resample_for_the_given_model,
    compare_with_given_model,
    answer,
)
"""The diagnosis, in the order in which the passes run."""
