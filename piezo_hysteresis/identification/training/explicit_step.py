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

"""Recognises simulated data whose hysteresis loop was computed with the explicit step of Eq. (7).

A rate-independent loop responds to a jump as to a slow ramp. The explicit step does not: it extrapolates linearly over
one sample, with an error of 1 % of the range in a jump of a tenth of the range. This error has no free parameter: the
data contain it completely or not at all.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace

import numpy as np

from ...blocks.block import Array
from ...effects import BoucWen
from ...effects.hysteresis.explicit_bouc_wen import ExplicitBoucWen
from ...model.model import Model
from ...record import Experiment, Notice, Record
from ..fit.cross_validation import cross_validate
from ..fit.normal_equations import grams
from ..records.conditioning import with_conditioning
from ..records.sampling import is_faster, less, resampled
from .adjusted_numbers import adjusted_numbers, directions
from .joint_fit import FAILURES, LATER, joint
from .training_data import TrainingData

KIND = "explicit_step"
"""Kind of the notice about an experiment from which the error was subtracted."""
SEEN = 0.5
"""Smallest detectable change of a record, in floors."""
BETTER = 0.9
"""Largest share of the cost that may remain after the subtraction."""
PRESENT, LEFT = 0.7, 0.3
"""Tolerance of the share of the changes in the residual: from 1 before the subtraction, and from 0 after it."""
TURNS = 4
"""Largest number of iterations."""


def step_changes(model: Model, records: Sequence[Record]) -> list[Array]:
    """Error of the explicit step in the displacement of every record [m], for a model with the exact loop, shape (n,).

    It is zero in records with a longer sample period than that of the model, in which each sample results from many
    steps.

    Raises
    ------
    DivergenceError
        If the explicit step diverges.
    """
    loop = ExplicitBoucWen(**model[BoucWen.name].values)
    explicit = replace(model, effects=tuple(loop if e.name == BoucWen.name else e for e in model.effects))
    wanted = [i for i, r in enumerate(records) if r.sample_period < 1.001 * model.sample_period]
    kept = with_conditioning(records, wanted)
    part = [records[i] for i in kept]
    found = dict(zip(kept, zip(model.free_run(part), explicit.free_run(part), strict=True), strict=True))
    return [found[i][1] - found[i][0] if i in wanted else np.zeros(r.size) for i, r in enumerate(records)]


def explicit_model(model: Model, training_data: TrainingData) -> Model | None:
    """The model of data that were simulated with the explicit step; None if the residual does not contain its error.

    The error computed with a model that was fitted to such data is not exact. The error is subtracted and the model
    fitted again, until both agree.
    """
    if BoucWen.name not in model:
        return None
    records, floors = training_data.records, training_data.floors
    with suppress(*FAILURES):
        changes = step_changes(model, records)
        share = _share(model, training_data, changes) if _largest(changes, floors) > SEEN else 0.0
        if abs(share - 1.0) > PRESENT:
            return None
        cost = joint(model, training_data, LATER).cost
        for _ in range(TURNS):
            freed = replace(training_data, records=less(records, changes))
            found = joint(model, freed, LATER)
            if found.cost > BETTER * cost:
                return None
            model, before = found.model, changes
            changes = step_changes(model, records)
            if _largest([a - b for a, b in zip(changes, before, strict=True)], floors) < SEEN:
                break
        if abs(_share(model, freed, changes)) < LEFT:
            return model
    return None


def _largest(changes: Sequence[Array], floors: Array) -> float:
    """Largest RMS change of a record, in units of its floor."""
    return max(float(np.sqrt(np.mean(c**2))) / f for c, f in zip(changes, floors, strict=True))


def _share(model: Model, training_data: TrainingData, changes: list[Array]) -> float:
    """Share of the changes in the residual, fitted linearly together with all free parameters of the model."""
    names = adjusted_numbers(model, training_data)
    rows = [c[None, :] for c in changes]
    products = grams(model, training_data.records, names, training_data.free_with(model), rows)
    return float(cross_validate(products, training_data.floors, directions(model, names, 1)).step[-1])


def without_steps(experiment: Experiment, model: Model) -> Experiment:
    """The experiment without the error of the explicit step, with a notice about this."""
    period = model.sample_period
    records = tuple(resampled(r, period) if is_faster(r, period) else r for r in experiment.records)
    freed = less(records, step_changes(model, records))
    message = (
        "the data were simulated with the explicit step of Eq. (7), which no real stage takes; its "
        "contribution was subtracted"
    )
    return replace(experiment, records=freed).noting(Notice(KIND, message))
