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

"""The joint fit of all free parameters of a model to the training data."""

from __future__ import annotations

from ...errors import DivergenceError, IdentificationError, ModelError, ParameterError
from ...model.model import Model
from ..fit.fit import Fit, fit
from ..fit.normal_equations import Linearised
from .adjusted_numbers import adjusted_numbers
from .training_data import TrainingData

TOLERANCE = 1e-3
"""Relative decrease of the cost at convergence of a refit."""
FIRST, LATER = 3, 9
"""Number of linearisations of a refit, before and after candidates far behind are dropped."""
LAST, PRECISE = 25, 1e-4
"""Number of linearisations of a last fit, and relative decrease of the cost at convergence."""
FAILURES = (DivergenceError, IdentificationError, ModelError, ParameterError)
"""Errors with which a trial fit may end."""


def joint(
    model: Model,
    training_data: TrainingData,
    max_iterations: int,
    tolerance: float = TOLERANCE,
    known: Linearised | None = None,
) -> Fit:
    """Joint fit of all free parameters of a model to the training data.

    `tolerance` is the relative decrease of the cost at convergence, `known` the linearisation of the model on these
    records, if there is one. The fit raises one of `FAILURES`, or a TimeSpentError if the time limit of the search has
    passed.
    """
    return fit(
        model,
        training_data.records,
        adjusted_numbers(model, training_data),
        floors=training_data.floors,
        nuisance=training_data.free_with(model),
        max_iterations=max_iterations,
        tolerance=tolerance,
        known=known,
    )
