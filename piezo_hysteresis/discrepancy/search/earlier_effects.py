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

"""Earlier effects judged again beside the newest one: superfluous ones, laws that are no longer best, uncertain ones.

An effect is chosen while others are missing. It can imitate a part of them, and its law may be one that does.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from ...effects import Effect
from ...identification.records.noise_floor import ADEQUATE
from ...identification.training.joint_fit import LATER
from ...identification.training.model_score import Fitted
from .acceptance_tests import is_certain
from .candidate_refits import best_of_each, finest, leaves_room, settled, simplest
from .candidates import FittedCandidate, screen
from .refit import collected, converged, refit, without
from .selection_result import FAR, NAMED, Step, explained


def certain(steps: Sequence[Step]) -> list[Step]:
    """The steps without the effects that may be absent beside all others.

    Only the last model shows this: while an effect is missing, the misfit makes the intervals of others wide. Its fit
    is converged before an effect is refused.
    """
    kept, is_precise = list(steps), False
    while accepted := [step for step in kept if step.accepted]:
        found = _possibly_absent(accepted, is_precise) or _unconvincing(accepted)
        if found is None:
            break
        if not is_precise:
            precise = replace(accepted[-1], best=converged(accepted[-1].best))
            kept, is_precise = [*accepted[:-1], precise, *kept[len(accepted) :]], True
            continue
        step, reason, alone = found
        if step is accepted[-1]:
            rejected = {step.best.name: reason, **step.rejected}
            kept = [*accepted[:-1], replace(step, accepted=False, rivals=(), rejected=rejected)]
            continue
        fewer = _taken_back(step, accepted, alone, reason)
        if fewer is None:
            break
        kept = [*fewer, *kept[len(accepted) :]]
    return kept


def _possibly_absent(accepted: Sequence[Step], is_precise: bool) -> tuple[Step, str, Fitted | None] | None:
    """The newest step whose effect may be absent by its interval, this reason, and the model without it; or None.

    It holds near the optimum. If the fit is precise, an effect without which the error is large is certain anyway.
    """
    for step in reversed(accepted):
        beside = _beside_newest(step, accepted)
        if is_certain(beside):
            continue
        alone = without(beside) if is_precise else None
        left = np.inf if alone is None else alone.score.excess
        if not is_precise or left <= FAR or _share(beside, alone) < NAMED:
            return step, "its interval does not exclude that it is absent", alone
    return None


def _unconvincing(accepted: Sequence[Step]) -> tuple[Step, str, Fitted | None] | None:
    """The step whose effect explains least beside the others, if this is too little for a name; else None.

    With the step, this reason and the model without the effect.

    What remains is then an error of form, of which the effect may only imitate a part. The smaller it is beside the
    floor, the less is asked of an effect.
    """
    remains = accepted[-1].best.score.excess
    if remains <= ADEQUATE:
        return None
    beside = [_beside_newest(step, accepted) for step in accepted]
    alone = [without(candidate) for candidate in beside]
    shares = [_share(*pair) for pair in zip(beside, alone, strict=True)]
    least = int(np.argmin(shares))
    if shares[least] >= min(NAMED, 1.0 - 1.0 / np.sqrt(remains)):
        return None
    reason = f"it explains only {100 * shares[least]:.0f} % of the gap of the model that was refitted without it"
    return accepted[least], reason, alone[least]


def _share(candidate: FittedCandidate, alone: Fitted | None) -> float:
    """Share of the gap of the model without an effect that the effect explains; 1 if this model diverges."""
    null = candidate.training_data.null
    return 1.0 if alone is None else explained(alone.score.excess, candidate.score.excess, null)


def in_best_laws(accepted: Sequence[Step], effects: Collection[type[Effect]]) -> list[Step]:
    """The steps with every earlier effect in the law that is best beside the newest one, as long as an error remains.

    The law was chosen when the newest effect was missing, and may have imitated a part of it.
    """
    steps = list(accepted)
    for place, step in enumerate(accepted[:-1]):
        newest, now = steps[-1].best, _beside_newest(step, steps)
        laws = [e for e in effects if e.public_name() == now.effect.public_name() and e.name != now.name]
        if not leaves_room(newest.score):
            continue
        rest = newest.fit.model.without(now.name)
        first = collected(partial(refit, rest, max_iterations=LATER), screen(rest, newest.training_data, laws))
        tried = [now, *collected(partial(settled, before=step.before), first)]
        best = finest(simplest(best_of_each(tried)), step.before)
        alone = refit(step.best.fit.model.without(now.name), best, LATER) if best is not now else None
        if alone is not None:
            steps[place] = replace(step, best=alone)
            steps[place + 1] = replace(steps[place + 1], before=alone.score)
            steps[-1] = replace(steps[-1], best=replace(best, effect=best.fit.model[newest.name]))
    return steps


def _beside_newest(step: Step, accepted: Sequence[Step]) -> FittedCandidate:
    """The effect of a step in the newest model, which contains all effects."""
    newest = accepted[-1].best
    return replace(newest, effect=newest.fit.model[step.best.name])


def _taken_back(step: Step, accepted: Sequence[Step], alone: Fitted | None, reason: str) -> list[Step] | None:
    """The accepted steps without an earlier one, from the newest model without its effect; None without a fit."""
    newest = accepted[-1].best
    if alone is None:
        return None
    best = refit(alone.model.without(newest.name), replace(newest, effect=alone.model[newest.name]), LATER)
    if best is None:
        return None
    steps = list(accepted)
    place = steps.index(step)
    steps[place + 1] = replace(steps[place + 1], before=step.before)
    del steps[place]
    steps[-1] = replace(steps[-1], best=best, rejected={**steps[-1].rejected, step.best.name: reason})
    return steps
