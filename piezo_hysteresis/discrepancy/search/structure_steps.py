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

"""Steps from the published model to the structure that predicts best, one effect at a time."""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np

from ...effects import (
    MEMORY,
    Creep,
    CreepTwoRates,
    EvenInputPolynomial,
    ExtraResonance,
    ThermalDrift,
)
from ...errors import PiezoError
from ...identification.fit.fit import Fit
from ...identification.identification import Identification
from ...identification.structure.left_out import score_left_out
from ...identification.structure.linear_part import free_numbers
from ...identification.structure.piece_fit import fit_pieces
from ...identification.structure.pieces import pieces_of
from ...identification.structure.structure_choice import LEADS
from ...identification.structure.uncertainty import as_fit
from ...model.model import Model
from ...record import Record
from .candidates import FittedCandidate, score_model
from .cross_validation import Score
from .selection_result import Step
from .training_data import TrainingData

ORDER = (
    MEMORY.name,
    ExtraResonance.name,
    Creep.name,
    CreepTwoRates.name,
    EvenInputPolynomial.name,
    MEMORY.level_term.name,
)
"""Optional effects of a structure, the largest first."""
SLOW = (Creep.name, CreepTwoRates.name)
"""Effects that drift can imitate."""
FEW = 8
"""Number of linearisations of an intermediate model, which starts near its optimum."""


def decided(found: Identification) -> list[str]:
    """Effects of the chosen structure that cross-validation clearly requires, largest first.

    A level dependence of plays is certain only if the plays are: the operator may need no such term.
    """
    if found.structure is None:
        return []
    leads = found.structure.leads
    certain = [n for n in ORDER if leads.get(n, 0.0) >= LEADS and n in found.model]
    return [n for n in certain if n != MEMORY.level_term.name or MEMORY.name in certain]


def structure_steps(
    found: Identification,
    before: Score,
    training_data: TrainingData,
    records: Sequence[Record],
    floors: Sequence[float],
    fitted: Collection[int],
) -> list[Step]:
    """One accepted step for every certain effect, in the order of their size.

    Parameters
    ----------
    found : Identification
        Identification with a chosen structure.
    before : Score
        Score of the published model.
    training_data : TrainingData
        Data for the scores.
    records : sequence of Record
        Records in order.
    floors : sequence of float
        Floor of every record [m].
    fitted : collection of int
        Indices of the fitted records.
    """
    names = decided(found)
    steps: list[Step] = []
    later = list(names)
    for name in names:
        later.remove(name)
        model = found.model
        for other in later:
            model = model.without(other)
        if MEMORY.name not in model:
            model = model.without(MEMORY.level_term.name)
        try:
            fit = found.fit if not later else _refitted(model, records, floors, fitted)
            score = score_model(fit.model, training_data)
            rivals = _rivals(found, name, training_data, records, floors, fitted)
        except PiezoError:
            continue
        best = FittedCandidate(fit.model[name], training_data, score, fit)
        steps.append(Step(before, best, True, rivals, ()))
        before = score
    return steps


def _refitted(model: Model, records: Sequence[Record], floors: Sequence[float], fitted: Collection[int]) -> Fit:
    pieces = pieces_of(records, fitted)
    found = fit_pieces(model, pieces, floors, free_numbers(model), FEW)
    return as_fit(found, pieces, floors, np.zeros((len(found.names),) * 2))


def _rivals(
    found: Identification,
    name: str,
    training_data: TrainingData,
    records: Sequence[Record],
    floors: Sequence[float],
    fitted: Collection[int],
) -> tuple[FittedCandidate, ...]:
    """A drift instead of creep, if cross-validation is about as good."""
    if name not in SLOW or ThermalDrift.name in found.model:
        return ()
    start = ThermalDrift.starts(training_data.extent)[0]
    drift = _refitted(found.model.without(name).with_effect(start), records, floors, fitted)
    behind = score_left_out(drift.model, records, floors, fitted) - score_left_out(found.model, records, floors, fitted)
    if behind >= LEADS:
        return ()
    score = score_model(drift.model, training_data)
    return (FittedCandidate(drift.model[ThermalDrift.name], training_data, score, drift),)
