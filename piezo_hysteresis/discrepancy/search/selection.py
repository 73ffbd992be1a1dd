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

"""Forward selection of missing effects: score test, refit of the best, choice by cross-validation, repeat, stop.

Forward selection: Bacher and Madsen 2011. Why a discrepancy needs a structure: Brynjarsdóttir and O'Hagan 2014.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from contextlib import suppress

from ...effects import CATALOGUE, Effect
from ...identification.fit.cross_validation import Score
from ...identification.fit.fit import Progress
from ...identification.fit.normal_equations import residuals
from ...identification.fit.time_limit import TimeSpentError
from ...identification.records.noise_floor import ADEQUATE
from ...identification.training.model_score import Fitted
from ...identification.training.training_data import TrainingData
from ...model.model import Model
from .acceptance_tests import first_rejection
from .candidate_refits import (
    CLOSE,
    LEAST_GAIN,
    best_of_each,
    finest,
    leaves_room,
    refit_candidates,
    refits_behind_new_dynamics,
    refits_of_creep,
    refits_of_relatives,
    simplest,
)
from .candidates import Candidate, FittedCandidate, screen
from .earlier_effects import certain, in_best_laws
from .refit import converged, without
from .selection_result import NAMED, Selection, Step, explained

REFITS = 6
"""Number of candidates that are refitted jointly."""
MOST = 3
"""Largest number of effects."""


def select(
    model: Model,
    training_data: TrainingData,
    score: Score,
    effects: Collection[type[Effect]] = CATALOGUE,
    progress: Progress | None = None,
) -> Selection:
    """Add effects while cross-validation improves.

    Parameters
    ----------
    model : Model
        Fitted baseline.
    training_data : TrainingData
        Records for fitting and choosing.
    score : Score
        Score of the baseline.
    effects : collection of Effect classes
        Effects to choose from.
    progress : callable, optional
        Called with a message and the fraction done.
    """
    report = progress or (lambda word, fraction: None)
    steps, in_time = list[Step](), False
    now, reached, data = model, score, training_data
    with suppress(TimeSpentError):
        while leaves_room(reached) and len(steps) < MOST:
            start = steps[0].before if steps else reached
            step = _turn(now, data, reached, start, effects, report)
            if step is None:
                break
            if not steps and (better := _better_without(step)) is not None:
                model, now, score, reached = better.model, better.model, better.score, better.score
                continue
            steps.append(step)
            if not step.accepted:
                break
            steps = in_best_laws(steps, effects)
            best = steps[-1].best
            now, reached, data = best.fit.model, best.score, best.training_data
        steps = certain(steps)
        in_time = True
    found = next((step.best for step in reversed(steps) if step.accepted), None)
    now, reached, data = (found.fit.model, found.score, found.training_data) if found else (model, score, training_data)
    return Selection(model, now, reached, tuple(steps), data.null, in_time, data)


def _better_without(step: Step) -> Fitted | None:
    """The model refitted without a refused effect, if this lowers the cost: the baseline was in another minimum."""
    if step.accepted or step.before.excess <= ADEQUATE or step.before.cost - step.best.score.cost < LEAST_GAIN:
        return None
    alone = without(step.best)
    return alone if alone is not None and step.before.cost - alone.score.cost >= LEAST_GAIN else None


def _turn(
    model: Model,
    training_data: TrainingData,
    before: Score,
    start: Score,
    effects: Collection[type[Effect]],
    progress: Progress,
) -> Step | None:
    """One step: the best effect of those that the model does not contain; None if no refit converges."""
    progress("score test of the catalogue", 0.0)
    training_data = training_data.with_lines(residuals(model, training_data.records, training_data.free_with(model)))
    present = {e.public_name() for e in model.effects}
    twins = {e.name: t.name for e in effects for t in model.effects if e.is_twin_of(t)}
    tried = [e for e in effects if e.public_name() not in present and e.name not in twins]
    screened = screen(model, training_data, tried, is_small=before.excess <= ADEQUATE)
    refits, best, reason = _best_effect(model, screened, before, start, progress)
    if best is None:
        return None
    reason = reason or _untried_twin(type(best.effect), effects)
    gain, said = before.cost - best.score.cost, best.effect.public_name()
    rivals = list[FittedCandidate]()
    rejected = {name: f"on slow drive it equals {t}, which is in the model" for name, t in twins.items()}
    if reason is not None:
        rejected[best.name] = reason
    for fitted in (c for c in refits if c.name != best.name):
        lead, error = best.score.better_than(fitted.score)
        if reason is None and lead < CLOSE * gain and lead < 2.0 * error:
            rivals.append(fitted)
        else:
            rejected[fitted.name] = (
                f"in cross-validation its mean ln R² is {lead:.2f} ± {error:.2f} higher than with {said}"
            )
    others = [c for c in screened if all(c.name != r.name for r in refits)]
    for other in others:
        most = max(0.0, before.cost - other.score.cost)
        rejected[other.name] = (
            f"it is predicted to lower mean ln R² by at most {most:.2f}, where {said} lowers it by {gain:.2f}"
        )
    return Step(before, best, reason is None, tuple(rivals), rejected, (*refits, *others))


def _best_effect(
    model: Model, screened: Sequence[Candidate], before: Score, start: Score, progress: Progress
) -> tuple[list[FittedCandidate], FittedCandidate | None, str | None]:
    """Refits of the best candidates, the best of them, and why its effect is rejected or None."""
    best: FittedCandidate | None = None
    reason: str | None = None
    first = screened[:REFITS]
    if before.excess <= ADEQUATE:  # what remains is small
        first = [c for c in first if before.cost - c.score.cost >= LEAST_GAIN]
    refits = best_of_each(refit_candidates(model, first, before, progress))
    if refits:
        share = explained(start.excess, refits[0].score.excess, refits[0].training_data.null)
        if start.excess <= ADEQUATE and share < NAMED and not leaves_room(refits[0].score):  # none would follow
            said = f"the error is at the floor, and {100 * share:.0f} % of what is above the noise is explained"
            return refits, refits[0], said
        relatives = refits_of_relatives(screened, refits[0], before)
        refits = best_of_each([*refits, *relatives, *refits_of_creep(model, screened, refits[0])])
        best, reason = _judged(refits, before)
    tried = screened
    if best is not None and reason is None:  # a fit that leaves an error may have ended in another minimum
        same = best.effect.public_name() if best.score.excess > ADEQUATE else None
        tried = [c for c in screened if c.effect.public_name() == same]
    if late := refits_behind_new_dynamics(model, tried, before):
        refits = best_of_each([*refits, *late])
        best, reason = _judged(refits, before)
    return refits, best, reason


def _untried_twin(effect: type[Effect], effects: Collection[type[Effect]]) -> str | None:
    """Why an effect is rejected whose twin, which the data cannot distinguish from it, is not among the candidates."""
    twins = {e.public_name() for e in CATALOGUE if effect.is_twin_of(e)}
    untried = sorted(twins - {e.public_name() for e in effects})
    return f"on slow drive it equals {untried[0]}, which was not among the candidates" if untried else None


def _judged(refits: list[FittedCandidate], before: Score) -> tuple[FittedCandidate, str | None]:
    """The best refit, and why its effect is rejected or None."""
    best = finest(simplest(refits), before)
    if before.excess <= ADEQUATE:  # its interval decides
        best = converged(best)
    return best, first_rejection(best, before)
