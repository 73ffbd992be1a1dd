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

"""`diagnose`: a loop over the passes of `passes`, up to the first one that returns a diagnosis."""

from __future__ import annotations

import time
from collections.abc import Collection, Iterable
from dataclasses import replace

import numpy as np

from ..effects import CATALOGUE, Effect
from ..errors import DivergenceError, IdentificationError, ParameterError
from ..identification.fit.fit import Progress
from ..identification.inputs import experiment_of
from ..identification.one_core import on_one_core
from ..model.model import Model
from ..record import Notice, Record
from .changes.same_stage import UNCHANGED
from .diagnosis import Diagnosis
from .diagnosis_state import DiagnosisState
from .passes import PASSES
from .search.execution.cores import using_cores
from .verdict import Conclusion, Verdict

GIVEN_DIVERGES = "given_model_diverges"
"""Kind of the notice that the given model is not used."""


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
        Time after which the search ends with the best answer so far [s]. It does not limit the baseline before the
        search and the last fit after it.
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
        If `experiment` holds no records.
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
    progress = progress or (lambda word, fraction: None)
    recorded = experiment_of(experiment)
    state = DiagnosisState(recorded, model, effects, progress, end, explicit_step, given=recorded)
    # diverging trials have a large cost
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"), using_cores(cores):
        for run in PASSES:
            try:
                found = run(state)
            except (DivergenceError, IdentificationError) as error:
                cause = error.__cause__ or error  # a fit from diverging start values
                if state.model is None or not isinstance(cause, DivergenceError):
                    raise
                state = _without_given_model(state, cause)
                found = run(state)
            if isinstance(found, Diagnosis):
                return compared_with_given(found)
            state = found
    raise IdentificationError("diagnose: got no answer from the last pass, expected a diagnosis")


def _without_given_model(state: DiagnosisState, error: DivergenceError) -> DiagnosisState:
    """Continue with a model identified from the records, because the given one diverges on them."""
    said = f"the given model diverges on these records ({error}); the diagnosis begins with one identified from them"
    return replace(state, model=None, experiment=state.experiment.noting(Notice(GIVEN_DIVERGES, said)))


def compared_with_given(found: Diagnosis) -> Diagnosis:
    """Without a verdict, what is known of a given model is that nothing has changed since it was identified.

    If the time limit ended the search, the answer says so instead, because a longer search may find a name.
    """
    unchanged = any(n.kind == UNCHANGED for n in found.experiment.notices)
    if unchanged and found.verdict is Verdict.UNKNOWN and found.conclusion is not Conclusion.TIME_LIMIT:
        return replace(found, conclusion=Conclusion.NOTHING_CHANGED)
    return found
