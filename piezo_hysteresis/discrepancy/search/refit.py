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

"""Joint refits of candidates: from start values, continued, with newly estimated dynamics, and without the effect.

Linearised scores only rank effects. The gain of an effect is the improvement of a refit of the whole model with the
effect over a refit without it that had the same number of iterations.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from functools import partial, reduce
from typing import TypeVar

from ...identification.cores import on_cores
from ...identification.fit.form_uncertainty import LAG
from ...identification.fit.normal_equations import Linearised, residuals
from ...identification.fit.time_limit import check_time
from ...identification.records.noise_floor import ADEQUATE
from ...identification.steps.dynamics import Dynamics, best_arx, identify_arx
from ...identification.steps.linear_start import FEW_ITERATIONS, ITERATIONS, dynamics_signals, form_of, with_dynamics
from ...identification.steps.modes import identify_modes
from ...identification.training.joint_fit import FAILURES, FIRST, LAST, LATER, PRECISE, TOLERANCE, joint
from ...identification.training.model_score import Fitted, score_model, scored
from ...identification.training.training_data import TrainingData
from ...model.model import Model
from .candidates import BY_COST, Candidate, FittedCandidate

Item = TypeVar("Item")
Result = TypeVar("Result")

LINEAR = (LAG, "dynamics")
"""Families of effects that dynamics of sufficient order can contain."""


def collected(
    fit: Callable[[Item], Result | None],
    items: Sequence[Item],
    wanted: Callable[[Item, Sequence[Result]], bool] = lambda item, found: True,
) -> list[Result]:
    """Fits of the items that are wanted beside those found before, without the fits that diverged."""
    found = list[Result]()
    for _, result in on_cores(fit, items, lambda item: wanted(item, found)):
        if result is not None:
            found.append(result)
    return found


def refit(model: Model, candidate: Candidate, max_iterations: int) -> FittedCandidate | None:
    """Fit the model with the candidate jointly, from its start values; None if this diverges."""
    return _refitted(model.with_effect(candidate.effect), candidate, max_iterations)


def proceed(candidate: FittedCandidate) -> FittedCandidate:
    """Continue a refit from where it stopped; a refit that has converged is returned as it is."""
    if candidate.fit.converged:
        return candidate
    return _refitted(candidate.fit.model, candidate, LATER, candidate.fit.linearised) or candidate


def converged(candidate: FittedCandidate) -> FittedCandidate:
    """The refit continued to a precise optimum, where its interval says whether the effect may be absent."""
    return _refitted(candidate.fit.model, candidate, LAST, candidate.fit.linearised, PRECISE) or candidate


def _refitted(
    model: Model,
    candidate: Candidate,
    max_iterations: int,
    known: Linearised | None = None,
    tolerance: float = TOLERANCE,
) -> FittedCandidate | None:
    try:
        result = joint(model, candidate.training_data, max_iterations, tolerance, known)
        score = score_model(result.model, candidate.training_data, result.linearised)
    except FAILURES:
        return None
    return FittedCandidate(result.model[candidate.name], candidate.training_data, score, result)


def restart(candidate: FittedCandidate, max_iterations: int) -> FittedCandidate:
    """The refit with newly estimated dynamics, behind its own or the first loop; the old one if this is not better.

    The missing effect biased the old dynamics. A joint fit that starts with them needs many iterations. It may also
    have changed the loop so much that no step leads back, e.g. to a width of zero; then the error stays large.
    """
    models = [candidate.fit.model]
    if (first := candidate.training_data.start) is not None:
        models.append(reduce(Model.with_effect, [e for e in models[0].effects if e.name not in first], first))
    behind = partial(_behind_anew, training_data=candidate.training_data)
    found = collected(behind, models, lambda model, found: all(f.score.excess > ADEQUATE for f in found))
    anew = _from_best(found, candidate, max_iterations)
    return candidate if anew is None or anew.fit.cost >= candidate.fit.cost else anew


def from_all_starts(model: Model, candidate: Candidate) -> FittedCandidate | None:
    """Refit of the model with the candidate from the best start of its effect; None if all starts diverge.

    Every start is judged with newly estimated dynamics after few iterations. Noise that a limit distorts changes the
    estimated dynamics so much that the cost has several minima.
    """
    starts = type(candidate.effect).starts(candidate.training_data.extent)
    found = (_behind_anew(model.with_effect(start), candidate.training_data, (FEW_ITERATIONS,)) for start in starts)
    return _from_best(found, candidate, FIRST)


def refit_anew(model: Model, candidate: Candidate) -> FittedCandidate | None:
    """Refit of the model with the candidate from its start values and newly estimated dynamics; None if it diverges."""
    return _from_best([_behind_anew(model.with_effect(candidate.effect), candidate.training_data)], candidate, LATER)


def _from_best(starts: Iterable[Fitted | None], candidate: Candidate, max_iterations: int) -> FittedCandidate | None:
    best = min(filter(None, starts), key=BY_COST, default=None)
    return None if best is None else _refitted(best.model, candidate, max_iterations, best.linearised)


def _behind_anew(
    model: Model, training_data: TrainingData, choices: Sequence[int] = (FEW_ITERATIONS, ITERATIONS)
) -> Fitted | None:
    """The model with newly estimated dynamics; None if the records do not determine them.

    While an effect is missing, iterations that improve the fit of the broadband records may worsen that of the others.
    """
    check_time()
    broadband = training_data.broadband
    if not broadband:
        return None
    found = list[Fitted]()

    def behind(dynamics: Dynamics) -> Fitted:
        return scored(with_dynamics(model, dynamics.arx), training_data)

    with suppress(*FAILURES):
        left = residuals(model, training_data.records, training_data.free_with(model))
        signals = dynamics_signals(model, training_data.records, broadband, left)
        with suppress(*FAILURES):
            for dynamics in best_arx(signals, *form_of(model), choices):
                with suppress(*FAILURES):
                    found.append(behind(dynamics))
        if ITERATIONS in choices:
            found.append(behind(identify_modes(signals, *form_of(model), ITERATIONS)))
    return min(found, key=BY_COST, default=None)


def without(candidate: FittedCandidate) -> Fitted | None:
    """The candidate's model refitted without its effect; None if this diverges.

    The gain of this model over the model before is due to dynamics and hysteresis, and not to the effect. An effect
    that the dynamics can contain is no missing effect, although a joint fit may have stopped before they contained it.
    """
    model = candidate.fit.model.without(candidate.name)
    training_data = candidate.training_data
    is_linear = candidate.effect.family in LINEAR
    starts = [model, _absorbed(model, candidate.fit.model, training_data) if is_linear else None]
    fits = list[Fitted]()
    for start in filter(None, starts):
        with suppress(*FAILURES):
            fitted = joint(start, training_data, LATER)
            fits.append(scored(fitted.model, training_data, fitted.linearised))
    return min(fits, key=BY_COST, default=None)


def _absorbed(model: Model, extended: Model, training_data: TrainingData) -> Model | None:
    """The model with dynamics that imitate `extended`, which has one more linear effect; None if there are none.

    Without the effect, the model may diverge.
    """
    broadband = training_data.broadband
    if not broadband:
        return None
    records = training_data.records
    with suppress(*FAILURES):
        missed = [a - b for a, b in zip(extended.free_run(records), model.free_run(records), strict=True)]
        signals = dynamics_signals(model, records, broadband, missed)
        return with_dynamics(model, identify_arx(signals, *form_of(model), ITERATIONS).arx)
    return None
