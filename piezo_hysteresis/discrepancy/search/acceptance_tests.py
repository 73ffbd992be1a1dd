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

"""Acceptance tests: reasons to reject an effect although it improves the prediction."""

from __future__ import annotations

from ...effects import AmplifierSaturation
from .candidate_refits import LEAST_GAIN
from .candidates import FittedCandidate
from .cross_validation import Score
from .refit import without
from .selection_result import Rejection, typical

KEEPS = 0.8
"""Largest share of V beyond noise that may remain after an effect."""


def first_rejection(best: FittedCandidate, before: Score) -> Rejection | None:
    """First reason to reject a fitted candidate; None if it passes all tests. The cheap tests come first."""
    gain = before.cost - best.score.cost
    if gain < LEAST_GAIN:
        return Rejection(
            best.name, f"in cross-validation it lowers mean ln R² by {gain:.2f}, and {LEAST_GAIN:g} is needed"
        )
    left = share_left(best.score, before, best.training_data.null)
    if left > KEEPS:
        return Rejection(
            best.name, f"{100 * left:.0f} % of the excess error remains, and {100 * KEEPS:.0f} % is allowed"
        )
    alone = without(best)
    owed = LEAST_GAIN if alone is None else alone.score.cost - best.score.cost
    if owed < LEAST_GAIN:
        return Rejection(best.name, f"it gains only {owed:.2f} over the model that was refitted without it")
    return None


def share_left(after: Score, before: Score, null: float) -> float:
    """Share of V beyond noise that remains; the worst record is ignored."""
    first, second = typical(before, after)
    return max(0.0, second - null) / max(first - null, 1e-12)


def bends_all_along(candidate: FittedCandidate) -> bool:
    """Whether a limit bends over more than the whole drive range, so that it is a curve and not a limit."""
    saturates = candidate.name == AmplifierSaturation.name
    return saturates and candidate.effect["corner"] > candidate.training_data.extent.span
