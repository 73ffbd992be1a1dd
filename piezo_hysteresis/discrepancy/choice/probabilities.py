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

"""Probability of every explanation: each candidate, "nothing", and "none of these". They sum to one.

The evidence is the likelihood of records that were left out of the fit (criterion C of docs/gap.md). The contribution
of each record is limited, so that no single record decides.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping

import numpy as np
import scipy

from ...identification.fit.cross_validation import Score
from ...identification.fit.form_uncertainty import PIECES
from ...identification.records.noise_floor import ADEQUATE
from ..diagnosis import Diagnosis
from ..search.selection_result import Step, share_for_a_name
from ..verdict import Verdict
from .time_to_decide import ONE_RECORD

NOTHING, NONE_OF_THESE = "nothing", "none of these"
"""The two explanations that are not effects of the catalogue."""
PRIOR_NOTHING, PRIOR_NONE = 0.4, 0.1
"""Prior probabilities that nothing is missing, and that the missing effect is not in the catalogue."""


def probabilities(found: Diagnosis, effects: Collection[str], unplayed: Collection[str] = ()) -> dict[str, float]:
    """Probability of every explanation after the records of a diagnosis.

    Parameters
    ----------
    found : Diagnosis
        Diagnosis of the records so far.
    effects : collection of str
        Public names of the effects in the catalogue.
    unplayed : collection of str
        Effects that the phases so far could not show; they keep their prior probability if nothing is missing.

    Returns
    -------
    dict of str to float
        Probability by explanation; they sum to one. Several effects together are one explanation, e.g.
        ``"creep + backlash"``. ``"creep + none of these"`` is creep and an effect that is not in the catalogue.
    """
    prior = {NOTHING: PRIOR_NOTHING, NONE_OF_THESE: PRIOR_NONE}
    prior |= dict.fromkeys(sorted(effects), (1.0 - PRIOR_NOTHING - PRIOR_NONE) / max(len(effects), 1))
    selection = found.selection
    if selection is None:
        return _to_one(prior)
    if not selection.steps:
        seen = {name: p for name, p in prior.items() if name == NOTHING or name in unplayed}
        if found.verdict is Verdict.NOTHING_MISSING:
            return _to_one(seen)
        return _to_one(seen | {NONE_OF_THESE: PRIOR_NONE})
    total: dict[str, float] = {}
    weight, so_far = 1.0, tuple[str, ...]()
    for step in selection.steps:
        last = step is selection.steps[-1]
        if not step.accepted and not (last and not so_far):
            continue
        later = {s.best.effect.public_name() for s in selection.accepted[len(so_far) + 1 :]}
        shares = step_probabilities(step, prior, selection.null, selection.score if later else None)
        kept = {step.best.effect.public_name(), *later} if step.accepted else set()
        for name, share in shares.items():
            if name not in kept:
                known = name in effects or found.verdict is Verdict.NAMED
                label = " + ".join((*so_far, name)) if known else NONE_OF_THESE
                label = (" + ".join(so_far) or NOTHING) if name == NOTHING else label
                total[label] = total.get(label, 0.0) + weight * share
        if kept:
            weight *= sum(shares.get(name, 0.0) for name in kept)  # the same effects, in whatever order they are added
            so_far = (*so_far, step.best.effect.public_name())
    if so_far:
        label = " + ".join(so_far) if found.verdict is Verdict.NAMED else NONE_OF_THESE
        total[label] = total.get(label, 0.0) + weight
    return _to_one(total)


def step_probabilities(
    step: Step, prior: Mapping[str, float], null: float, reached: Score | None = None
) -> dict[str, float]:
    """Probability of every explanation in one step of the search.

    Parameters
    ----------
    step : Step
        The step, with every candidate that was tried.
    prior : mapping of str to float
        Prior probabilities of the candidates and of the two other explanations.
    null : float
        V of a perfect model.
    reached : Score, optional
        Score after the last step, if more effects were added after this one. An effect of this step does not have to
        explain the gap alone, so *nothing* and *none of these* are compared with all effects together.
    """
    others: dict[str, Score] = {NOTHING: tolerant(step.before), NONE_OF_THESE: part_explained(step.before, null)}
    scores = {} if reached is not None else dict(others)
    for candidate in step.tried:
        name = candidate.effect.public_name()
        if name not in scores or candidate.score.cost < scores[name].cost:
            scores[name] = candidate.score
    equals = set(step.confusable_with)
    best = min(scores, key=lambda name: scores[name].cost)
    behind = {}
    for name, score in scores.items():
        behind[name] = log_odds(scores[best], score)
        if name in equals:
            behind[name] = min(behind[name], scatter_odds(scores[best], score))
    if reached is not None:
        leader = min((reached, *others.values()), key=lambda score: score.cost)
        behind = {name: distance + log_odds(leader, reached) for name, distance in behind.items()}
        behind |= {name: log_odds(leader, score) for name, score in others.items()}
    logs = {name: np.log(prior.get(name, min(prior.values()))) - distance for name, distance in behind.items()}
    top = max(logs.values())
    return _to_one({name: float(np.exp(value - top)) for name, value in logs.items()})


def log_odds(best: Score, other: Score) -> float:
    """Log-odds of the first explanation against the second, Σ min(4, m/2 (C_other − C_best)) over the records."""
    leads = 0.5 * PIECES * (other.logs - best.logs)
    return max(0.0, float(np.sum(np.clip(leads, -ONE_RECORD, ONE_RECORD))))


def scatter_odds(best: Score, other: Score) -> float:
    """Log-odds that the mean lead is not due to the choice of records: Student's t, with records as units."""
    lead, error = best.better_than(other)
    if not np.isfinite(error):
        return 0.0
    wrong = float(scipy.stats.t.sf(lead / max(error, 1e-12), best.ratios.size - 1))
    return max(0.0, float(np.log1p(-wrong) - np.log(max(wrong, 1e-300))))


def tolerant(score: Score) -> Score:
    """The score with errors up to the adequacy limit set to the floor."""
    return Score(score.ratios / np.sqrt(ADEQUATE), score.step)


def part_explained(before: Score, null: float) -> Score:
    """Score of a wrong explanation that by chance removes, in every record, the share of the gap needed for a name."""
    share = share_for_a_name(before.excess)
    gap = np.maximum(before.ratios**2 - null, 0.0)
    return Score(np.sqrt(null + (1.0 - share) ** 2 * gap), before.step)


def _to_one(weights: Mapping[str, float]) -> dict[str, float]:
    total = sum(weights.values())
    shares = {name: weight / total for name, weight in weights.items()}
    return dict(sorted(shares.items(), key=lambda item: -item[1]))
