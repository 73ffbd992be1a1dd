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

"""`Step` and `Selection`: the result of the forward selection, step by step."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ...identification.fit.cross_validation import Score
from ...identification.training.training_data import TrainingData
from ...model.model import Model
from .candidate_refits import LEAST_GAIN
from .candidates import Candidate, FittedCandidate

FAR = 10.0
"""V above which the remaining error is large: a similar effect of another family may explain as much of the gap."""
NAMED, NAMED_FAR = 0.6, 0.75
"""Smallest explained fraction of the gap for a name, and the same if the remaining error is large."""


@dataclass(frozen=True, eq=False, slots=True)
class Step:
    """One step of the selection.

    Parameters
    ----------
    before : Score
        Score of the model without the effect.
    best : FittedCandidate
        The best refit.
    accepted : bool
        Whether the effect was added.
    rivals : tuple of FittedCandidate
        Refits that cross-validation cannot distinguish from the best.
    rejected : mapping of str to str
        All other effects, by name, and why each was not added.
    tried : tuple of Candidate
        Every effect of this step with its score, refitted or, if it was too far behind, linearised at its start.
    """

    before: Score
    best: FittedCandidate
    accepted: bool
    rivals: tuple[FittedCandidate, ...]
    rejected: Mapping[str, str]
    tried: tuple[Candidate, ...] = ()

    @property
    def confusable_with(self) -> tuple[str, ...]:
        """Effects that explain the data equally well."""
        names = dict.fromkeys(r.effect.public_name() for r in self.rivals)
        return tuple(n for n in names if n != self.best.effect.public_name())

    @property
    def member_certain(self) -> bool:
        """True if no other member of the same family is a rival."""
        mine = self.best.effect
        return all(r.effect.family != mine.family or r.effect.public_name() == mine.public_name() for r in self.rivals)


@dataclass(frozen=True, eq=False, slots=True)
class Selection:
    """Result of the forward selection.

    Parameters
    ----------
    baseline : Model
        Model at the start of the selection.
    model : Model
        Model with all accepted effects.
    score : Score
        Score of `model`.
    steps : tuple of Step
        Steps in order; the last one may not be accepted.
    null : float
        V of a perfect model.
    in_time : bool
        False if the time limit ended the search, so that more effects may be missing.
    training_data : TrainingData or None
        Records of the search; None if the verdict comes from single records.
    """

    baseline: Model
    model: Model
    score: Score
    steps: tuple[Step, ...]
    null: float
    in_time: bool = True
    training_data: TrainingData | None = None

    @property
    def accepted(self) -> tuple[Step, ...]:
        """The steps that added an effect."""
        return tuple(s for s in self.steps if s.accepted)

    @property
    def alternative(self) -> FittedCandidate | None:
        """The refit with one more effect, which improves the prediction enough but may be absent; None without one."""
        last = self.steps[-1] if self.steps else None
        if last is None or last.accepted or last.before.cost - last.best.score.cost < LEAST_GAIN:
            return None
        return last.best

    def explained(self, score: Score) -> float:
        """Share X of the gap of the baseline that is explained at a score, 0 to 1."""
        first = self.steps[0].before if self.steps else self.score
        return explained(first.excess, score.excess, self.null)


def share_for_a_name(excess: float) -> float:
    """Smallest explained fraction of the gap for a name, if the error V remains."""
    return NAMED if excess <= FAR else NAMED_FAR


def explained(before: float, after: float, null: float) -> float:
    """X = 1 − √((V_after − V_null)/(V_before − V_null)), between 0 and 1."""
    gap = before - null
    return float(1.0 - np.sqrt(np.clip((after - null) / gap, 0.0, 1.0))) if gap > 0 else 1.0
