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

"""The score of a model on records left out of the fit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from ...blocks.block import Array
from ...model.model import Model
from ..fit.bounded_step import room_of
from ..fit.cross_validation import Score, cross_validate, indispensable
from ..fit.fit import Fit
from ..fit.normal_equations import Gram, Linearised, linearised_by
from .adjusted_numbers import adjusted_numbers, directions
from .training_data import TrainingData


@dataclass(frozen=True, eq=False, slots=True)
class Fitted:
    """A model, its score, and its linearisation on the same records."""

    model: Model
    score: Score
    linearised: Linearised


def scored(model: Model, training_data: TrainingData, known: Linearised | None = None) -> Fitted:
    """A model with its score, from its linearisation if it is known."""
    at = linearised(model, training_data, known)
    return Fitted(model, score_model(model, training_data, at), at)


def score_model(model: Model, training_data: TrainingData, known: Linearised | None = None) -> Score:
    """Score of a fitted model on records left out; `known` is what `linearised` would find, if a fit has found it."""
    at = linearised(model, training_data, known)
    return score_of(model, at.names, training_data, at.grams, directions(model, at.names))


def score_baseline(fit: Fit, training_data: TrainingData) -> tuple[TrainingData, Score]:
    """The training data and the score. A record that alone determines a parameter of the model is never left out."""
    at = linearised(fit.model, training_data, fit.linearised)
    alone = indispensable(at.grams, training_data.floors, directions(fit.model, at.names))
    training_data = replace(training_data, alone=alone)
    return training_data, score_model(fit.model, training_data, at)


def linearised(model: Model, training_data: TrainingData, known: Linearised | None = None) -> Linearised:
    """The model linearised by the parameters that a joint fit adjusts; `known` itself, if it is by these."""
    names, free = adjusted_numbers(model, training_data), training_data.free_with(model)
    return linearised_by(model, training_data.records, names, free, known)


def score_of(
    model: Model, names: Sequence[str], training_data: TrainingData, products: Sequence[Gram], columns: Array
) -> Score:
    """Score of a model from the inner products by the parameters `names`, in the directions `columns`."""
    room = room_of(model, names, columns)
    return cross_validate(products, training_data.floors, columns, training_data.alone, room)
