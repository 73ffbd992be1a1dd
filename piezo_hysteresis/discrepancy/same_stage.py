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

"""`same_stage`: diagnosis of a stage that differs from a given model in one parameter only."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..changes.change_sentence import sentence_of
from ..changes.changed_model import changed_model
from ..changes.parameter_changes import UNCHANGED, error_ratio, find_change
from ..errors import DivergenceError, ModelError, ParameterError
from ..identification.records.comparable import comparable
from ..identification.records.noise_floor import floors, noise_floors, stroke
from ..model.model import Model
from ..model.provenance import LARGEST, MOVING, data_hash, known_error, knows_unseen_records, record_errors
from ..record import Notice, Record
from .diagnosis import Diagnosis
from .diagnosis_state import DiagnosisState
from .gap import measure_gap
from .localise import located
from .verdict import Conclusion

UNCHANGED_STAGE = "unchanged"
"""Kind of the notice that the given model is still as good as when it was identified, as far as its error shows."""


def same_stage(state: DiagnosisState, model: Model) -> Diagnosis | Notice | None:
    """Name the parameter that has changed since the given model was identified.

    Otherwise a notice that no change is visible, or that the error has grown although no changed parameter explains it.
    None if the model does not state its error or diverges, or was identified from these data, which show no change.
    """
    experiment, records, used = state.experiment, state.experiment.records, state.moving
    recorded = experiment if state.given is None else state.given
    hashes = {data_hash(e) for e in (experiment, recorded, comparable(recorded)[0])}
    if model.provenance.get("data_hash") in hashes or not used:
        return None
    least = floors(records, noise_floors(records))
    known = known_error(model, MOVING)
    limits = np.maximum(least, known).tolist()
    try:
        change = find_change(
            model, records, used, limits, lambda part: state.progress("changes of the given model", 0.1 * part)
        )
        if change is None:
            return _without_change(model, records, used, limits) if known else None
        changed = changed_model(model, change, records)
        where = located(model, records, used, least, offset=True)
        gap = measure_gap((model, changed), records, used, least, stroke(records), unseen=False, offset=True)
    except (DivergenceError, ModelError, ParameterError):
        return None
    if not gap.after < gap.before:
        return None
    return Diagnosis(
        conclusion=Conclusion.CHANGED_PARAMETER,
        reason=sentence_of(change),
        model=_stated(model, gap.stated_by(changed, experiment)),
        baseline=model,
        experiment=experiment,
        where=where,
        gap=gap,
        change=change,
    )


def _without_change(model: Model, records: Sequence[Record], used: Sequence[int], limits: Sequence[float]) -> Notice:
    """What is known if no changed parameter explains the records: the error has grown, or no change is visible."""
    ratio, known = error_ratio(model, records, used, limits), known_error(model, MOVING)
    apart = "apart from its zero, gain and loop height"
    if ratio > UNCHANGED:
        said = f"{apart}, the given model has {ratio:.2g} times its known error"
        return Notice("grown_error", f"{said}: something has changed, or these drives show an error that it always had")
    percent = 100.0 * known / stroke(records)
    return Notice(
        UNCHANGED_STAGE,
        f"no change beyond the known error is visible since the model was identified: {apart}, which differ from day "
        f"to day, its error is within the known {1e9 * known:.3g} nm ({percent:.3g} % of the range); a smaller change "
        "may be hidden in it",
    )


def _stated(before: Model, after: Model) -> Model:
    """The changed model; where its few numbers made it better than before, it may be so on these records only."""
    largest, moving = (max(known_error(model, key) for model in (before, after)) for key in (LARGEST, MOVING))
    unseen = knows_unseen_records(before)
    return replace(after, provenance={**after.provenance, **record_errors(largest, moving, unseen)})
