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

"""`diagnose`: prepares the records, compares them with a given model, and answers from few records or from many."""

from __future__ import annotations

import time
from collections.abc import Collection, Iterable
from dataclasses import replace

import numpy as np

from ..effects import CATALOGUE, Effect
from ..errors import DivergenceError, IdentificationError, ParameterError
from ..identification.cores import using_cores
from ..identification.fit.fit import Progress
from ..identification.inputs import experiment_of
from ..identification.one_core import on_one_core
from ..identification.records.comparable import comparable
from ..identification.records.excitation_check import check_motion, moves
from ..identification.records.roles import roles_of
from ..identification.records.sampling import is_faster, resampled
from ..identification.structure.state_at_rest import begun_as_conditioned, without_hidden_start, without_hidden_state
from ..model.model import Model
from ..record import Notice, Record
from .diagnosis import Diagnosis
from .diagnosis_state import DiagnosisState
from .many_records import diagnose_many
from .same_stage import UNCHANGED_STAGE, same_stage
from .single_record import diagnose_few
from .unnamed.correction import without_corrections
from .verdict import FEWEST_RECORDS, Conclusion, Verdict

GIVEN_DIVERGES = "given_model_diverges"
"""Kind of the notice that the given model is not used."""
AS_GOOD = "The given model is as good as when it was identified."
"""First sentence of the reason if no change is visible."""
RESAMPLED = "resampled"
"""Kind of the notice about records that are faster than the given model."""


@on_one_core
def diagnose(
    experiment: Record | Iterable[Record],
    model: Model | None = None,
    *,
    effects: Collection[type[Effect]] = CATALOGUE,
    progress: Progress | None = None,
    explicit_step: bool = False,
    time_limit: float = np.inf,
    cores: int | None = None,
) -> Diagnosis:
    """Find where simulation and measurement disagree, name the missing effect, and measure the gap after adding it.

    Parameters
    ----------
    experiment : Experiment, Record, or iterable of Record
        Records of any kind. More kinds, and more realisations of each kind, make the name more certain.
    model : Model, optional
        Model with which the search begins; identified from the experiment by default.
    effects : collection of Effect classes
        Effects to choose from; the whole catalogue by default.
    progress : callable, optional
        Called with a message and the fraction done.
    explicit_step : bool
        Subtract the error of the explicit step of Eq. (7), which only data of a simulation can contain. By default,
        data in which nothing else is missing have the verdict unknown, and the reason names this option.
    time_limit : float
        Time after which the search ends with the best answer so far [s]. It does not limit the fit of the published
        model and the comparison with a given one before the search, and the last fit after it.
    cores : int, optional
        Largest number of processor cores that are used, at most 4; by default all that this process may use, or as many
        as the environment variable PYTHON_CPU_COUNT states. The answer does not depend on it.

    Returns
    -------
    Diagnosis
        The verdict (named, nothing missing, or unknown), and the extended model.

    Raises
    ------
    ParameterError
        If the time limit is not positive, no core may be used, or `effects` holds something else than classes of
        effects.
    RecordError
        If `experiment` holds no records, or one of several drives.
    IdentificationError
        If the drive does not move in any record that is compared with a model, or the displacement is constant.
    """
    if not time_limit > 0.0:
        raise ParameterError(f"diagnose: got a time limit of {time_limit:g} s, expected more than 0 s")
    if cores is not None and cores < 1:
        raise ParameterError(f"diagnose: got {cores} cores, expected at least 1")
    other = [e for e in effects if not (isinstance(e, type) and issubclass(e, Effect))]
    if other:
        raise ParameterError(f"diagnose: got {other[0]!r} in effects, expected classes of effects such as Creep")
    end = time.monotonic() + time_limit
    recorded, progress = experiment_of(experiment), progress or (lambda word, fraction: None)
    effects = without_hidden_start(effects, recorded.records)
    if model is not None:
        model = without_hidden_state(model, recorded.records)
    state = DiagnosisState(recorded, model, effects, progress, end, explicit_step, given=recorded)
    # diverging trials have a large cost
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"), using_cores(cores):
        state = prepare(state)
        return _begun(compared_with_given(_without_verdict(state) or _answer(_resampled(state))))


def _begun(found: Diagnosis) -> Diagnosis:
    """The answer, whose models begin as conditioning phases show."""
    if found.model is None or found.baseline is None:
        return found
    model, baseline = (begun_as_conditioned(m, found.experiment.records) for m in (found.model, found.baseline))
    return replace(found, model=model, baseline=baseline)


def prepare(state: DiagnosisState) -> DiagnosisState:
    """Remove the noise of a measured voltage, and cut records that begin in an unknown state, as `identify` does."""
    experiment, notices = comparable(state.experiment)
    return replace(state, experiment=experiment.noting(*notices)) if notices else state


def _without_verdict(state: DiagnosisState) -> Diagnosis | None:
    """The answer "unknown" if the data are damaged; an IdentificationError if nothing moves in them."""
    experiment = state.experiment
    if not any(moves(record) for record in experiment):
        raise IdentificationError("diagnose: the drive does not move in any record; expected loops, steps or noise")
    for severe in filter(lambda notice: notice.severe, experiment.notices):
        reason = f"No verdict is possible, because of the data: {severe.message}."
        return Diagnosis(Conclusion.INSUFFICIENT_DATA, reason, state.model, state.model, experiment)
    check_motion("diagnose", [experiment[i] for i in state.moving])
    return None


def _resampled(state: DiagnosisState) -> DiagnosisState:
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


def _answer(state: DiagnosisState) -> Diagnosis:
    """The answer; if the given model diverges on the records, it is that without a given model."""
    try:
        found = compare_with_given_model(state)
        if isinstance(found, Diagnosis):
            return found
        state = found
        return _searched(state)
    except (DivergenceError, IdentificationError) as error:
        cause = error.__cause__ or error  # a fit from diverging start values
        if state.model is None or not isinstance(cause, DivergenceError):
            raise
        said = f"the given model diverges on these records ({cause}); "
        noted = Notice(GIVEN_DIVERGES, said + "the diagnosis begins with one identified from them")
        return _searched(replace(state, model=None, experiment=state.experiment.noting(noted)))


def compare_with_given_model(state: DiagnosisState) -> DiagnosisState | Diagnosis:
    """The changed parameter, if the given model explains the records apart from this change; else the state with it."""
    model = state.model
    if model is None:
        return state
    found = same_stage(state, model)
    if isinstance(found, Notice):
        state, found = replace(state, experiment=state.experiment.noting(found)), None
    return found or replace(state, model=without_corrections(model))


def _searched(state: DiagnosisState) -> Diagnosis:
    """The answer of the search: with fewer than four records, or if none is broadband, from the chosen structure."""
    needs_structure = state.model is None and not roles_of(state.experiment).broadband
    is_many = len(state.moving) >= FEWEST_RECORDS and not needs_structure
    return diagnose_many(state) if is_many else diagnose_few(state)


def compared_with_given(found: Diagnosis) -> Diagnosis:
    """Without a verdict, what is known of a given model is that no change is visible since it was identified.

    If the time limit ended the search, the answer says so instead, because a longer search may find a name.
    """
    unchanged = any(n.kind == UNCHANGED_STAGE for n in found.experiment.notices)
    if unchanged and found.verdict is Verdict.UNKNOWN and found.conclusion is not Conclusion.TIME_LIMIT:
        return replace(found, conclusion=Conclusion.NOTHING_CHANGED, reason=f"{AS_GOOD} {found.reason}")
    return found
