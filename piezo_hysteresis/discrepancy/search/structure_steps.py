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
from contextlib import suppress
from functools import reduce

import numpy as np

from ...effects import HYSTERESIS, MEMORY, Creep, CreepTwoRates, EvenInputPolynomial, ExtraResonance, ThermalDrift
from ...errors import PiezoError
from ...identification.fit.cross_validation import Score
from ...identification.fit.fit import Fit
from ...identification.identification import Identification
from ...identification.left_out import score_left_out
from ...identification.steps.remaining_lag import AMPLIFIERS
from ...identification.structure.piece_fit import DELAY
from ...identification.structure.pieces import pieces_of
from ...identification.structure.pole_place import with_pole_behind
from ...identification.structure.structure_choice import CREEPS, LEADS
from ...identification.structure.structure_fit import fit_structure
from ...identification.structure.uncertainty import as_fit
from ...identification.training.model_score import score_model
from ...identification.training.training_data import TrainingData
from ...model.model import Model
from ...record import Record
from .candidates import FittedCandidate
from .selection_result import Step

POLES = tuple(form.name for form in AMPLIFIERS)
"""Forms of a pole before the hysteresis."""
ORDER = (
    MEMORY.name,
    *(term.name for term in (HYSTERESIS.start_term,) if term is not None),
    ExtraResonance.name,
    Creep.name,
    CreepTwoRates.name,
    EvenInputPolynomial.name,
    MEMORY.level_term.name,
    *POLES,
)
"""Optional effects of a structure, the largest first."""
FEW = 8
"""Number of linearisations of an intermediate model, which starts near its optimum."""


def structure_steps(
    found: Identification,
    before: Score,
    training_data: TrainingData,
    records: Sequence[Record],
    floors: Sequence[float],
    fitted: Collection[int],
) -> list[Step]:
    """One accepted step for every effect of the chosen structure that cross-validation clearly requires, largest first.

    A level dependence of plays is certain only if the plays are: the operator may need no such term. `before` is the
    score of the published model; `floors` [m] belongs to `records`, and the indices `fitted` count in them.
    """
    held = [n for n in (DELAY,) if n not in found.fit.names]

    def refitted(model: Model) -> Fit:
        pieces = pieces_of(records, fitted)
        by_pieces = fit_structure(model, pieces, floors, held, FEW)
        return as_fit(by_pieces, pieces, floors, np.zeros((len(by_pieces.names),) * 2))

    def candidate(name: str, fit: Fit) -> FittedCandidate:
        return FittedCandidate(fit.model[name], training_data, score_model(fit.model, training_data), fit)

    def rivals(name: str) -> tuple[FittedCandidate, ...]:
        """A drift instead of creep, which it can imitate, if cross-validation is about as good."""
        if name not in CREEPS or ThermalDrift.name in found.model:
            return ()
        start = ThermalDrift.starts(training_data.extent)[0]
        drift = refitted(found.model.without(name).with_effect(start))
        scores = [score_left_out(model, records, floors, fitted) for model in (drift.model, found.model)]
        return () if scores[0] - scores[1] >= LEADS else (candidate(ThermalDrift.name, drift),)

    leads = found.structure.leads if found.structure is not None else {}
    certain = [n for n in ORDER if leads.get(n, 0.0) >= LEADS and n in found.model]
    names = [n for n in certain if n != MEMORY.level_term.name or MEMORY.name in certain]
    steps: list[Step] = []
    for k, name in enumerate(names, 1):
        model = reduce(_without, names[k:], found.model)
        with suppress(PiezoError):
            best = candidate(name, refitted(model) if names[k:] else found.fit)
            steps.append(Step(before, best, True, rivals(name), {}))
            before = best.score
    return steps


def _without(model: Model, name: str) -> Model:
    """The model without an effect; the published model has the pole of an amplifier, too, but behind the hysteresis."""
    return with_pole_behind(model) if name in POLES else model.without(name)
