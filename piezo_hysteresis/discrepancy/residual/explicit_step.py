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

A loop without memory of speed goes through a jump as through a slow ramp. The explicit step does not: from one sample
to the next it moves straight on, by 1 % of the range too far in a jump of a tenth of it. What it changes has no number
of its own; it is all in the data, or nothing of it.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ...blocks.block import Block, State
from ...blocks.bouc_wen_kernel import (
    BETA,
    EXPONENT,
    GAMMA,
    H_REFERENCE,
    PHI1,
    PHI2,
    RATE,
    RATE_EXPONENT,
    A,
    rate_factor,
)
from ...blocks.kernel import kernel
from ...effects import BoucWen, Discretisation, Effect
from ...effects.hysteresis.bouc_wen import BoucWenBlock
from ...identification.fit.normal_equations import grams
from ...model.model import Model
from ...record import Experiment, Notice, Record
from ..search.candidates import directions, free_numbers
from ..search.cross_validation import cross_validate
from ..search.refit import FAILURES, joint
from ..search.training_data import TrainingData
from .sampling import at_period, less

Array = NDArray[np.float64]

KIND = "explicit_step"
"""Of the notice of an experiment from which the changes are taken."""
SEEN = 0.5
"""Change of a record in floors from which it can be reported."""
BETTER = 0.9
"""Share of the cost that may be left once the changes are taken out."""
PRESENT, LEFT = 0.7, 0.3
"""How far from the whole of the changes the share may be that the residual holds, and share left when they are out."""
TURNS = 4
"""Times that the changes are computed at most."""
LINEARISATIONS, PRECISE = 9, 1e-3
"""Linearisations of a fit at most, and relative decrease of the cost at which it has converged."""


@kernel
def run_explicit(v: Array, p: Array, p1: float, p2: float, sample_period: float, state: Array, w: Array) -> None:
    """The loop with all its terms, one explicit step per sample; arguments as `run_general`."""
    h, last = state[0], state[1]
    for i in range(v.size):
        x = v[i]
        dv = x - last
        if dv != 0.0:
            last = x
            size = abs(dv)
            gain = 1.0
            if p[RATE] != 0.0:
                gain += p[RATE] * rate_factor(size / sample_period, p[RATE_EXPONENT])
            power = abs(h / H_REFERENCE) ** (p[EXPONENT] - 1.0) if p[EXPONENT] != 1.0 else 1.0
            loss = power * (p[BETA] * size * h + p[GAMMA] * dv * abs(h))
            h += gain * p[A] * dv - loss + p[PHI1] * dv * h + p[PHI2] * size * abs(h)
        w[i] = p1 * x * x * x + p2 * x + h
    state[0], state[1] = h, last


class ExplicitBoucWen(BoucWen):
    """The loop of `BoucWen` with its terms, integrated by the explicit step."""

    def block(self, setting: Discretisation, terms: tuple[Effect, ...] = ()) -> Block:
        return ExplicitBlock(self, setting, terms)


class ExplicitBlock(BoucWenBlock):
    """Only for simulation: its sensitivities are those of the exact step."""

    def run(self, x: Array, state: State) -> tuple[Array, State]:
        w, state = np.empty_like(x), state.copy()
        run_explicit(x, self.loop, self.p1, self.p2, self.sample_period, state, w)
        return w, state


def step_changes(model: Model, records: Sequence[Record]) -> list[Array]:
    """What the explicit step changes in the displacement [m] of records at the model's own sample period.

    Parameters
    ----------
    model : Model
        With the exact loop, and its terms.
    records : sequence of Record
        In order.

    Returns
    -------
    list of (n,) ndarray
        By record; zero where the sample period is longer, so that many steps stand behind every sample.

    Raises
    ------
    DivergenceError
        Where the explicit step runs away.
    """
    loop = ExplicitBoucWen(**model[BoucWen.name].values)
    explicit = replace(model, effects=tuple(loop if e.name == BoucWen.name else e for e in model.effects))
    pairs = zip(records, model.free_run(records), explicit.free_run(records), strict=True)
    own = 1.001 * model.sample_period
    return [b - a if r.sample_period < own else np.zeros(r.size) for r, a, b in pairs]


def explicit_model(model: Model, training_data: TrainingData, leaves: float = np.inf) -> Model | None:
    """The model behind data whose loop takes the explicit step; None where the residual does not hold its changes.

    Changes of a model that was fitted to stepped data are a little wrong: they are taken out and the model is fitted
    again, until both agree.

    Parameters
    ----------
    model : Model
        Fitted to the training data.
    training_data : TrainingData
        Records and floors.
    leaves : float
        Cost at most without the changes: a large effect that is still missing may look alike.
    """
    if BoucWen.name not in model:
        return None
    records, floors = training_data.records, training_data.floors
    with suppress(*FAILURES):
        changes = step_changes(model, records)
        share = _share(model, training_data, changes) if _largest(changes, floors) > SEEN else 0.0
        if abs(share - 1.0) > PRESENT:
            return None
        cost = joint(model, training_data, LINEARISATIONS, PRECISE).cost
        for _ in range(TURNS):
            freed = replace(training_data, records=less(records, changes))
            found = joint(model, freed, LINEARISATIONS, PRECISE)
            if found.cost > BETTER * cost:
                return None
            model, before = found.model, changes
            changes = step_changes(model, records)
            if _largest([a - b for a, b in zip(changes, before, strict=True)], floors) < SEEN:
                break
        if found.cost < leaves and abs(_share(model, freed, changes)) < LEFT:
            return model
    return None


def _largest(changes: Sequence[Array], floors: Array) -> float:
    """Largest change of a record in units of its floor, rms."""
    return max(float(np.sqrt(np.mean(c**2))) / f for c, f in zip(changes, floors, strict=True))


def _share(model: Model, training_data: TrainingData, changes: list[Array]) -> float:
    """Share of the changes that the residual holds beside all that the model can still adjust, by linear estimate."""
    names = free_numbers(model, training_data)
    rows = [c[None, :] for c in changes]
    products = grams(model, training_data.records, names, training_data.nuisance, rows)
    return float(cross_validate(products, training_data.floors, directions(model, names, 1)).step[-1])


def without_steps(experiment: Experiment, model: Model) -> Experiment:
    """The experiment as the exact loop would have answered; a notice reports this."""
    records = tuple(at_period(r, model.sample_period) if _is_faster(r, model) else r for r in experiment.records)
    freed = less(records, step_changes(model, records))
    message = (
        "the data were simulated with the explicit step of Eq. (7), which no real stage takes; its "
        "contribution was subtracted"
    )
    return replace(experiment, records=freed).noting(Notice(KIND, message))


def _is_faster(record: Record, model: Model) -> bool:
    return record.sample_period < 0.999 * model.sample_period
