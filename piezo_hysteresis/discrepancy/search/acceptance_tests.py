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

import numpy as np

from ...effects import AmplifierSaturation, MainsHum
from .candidate_refits import LEAST_GAIN
from .candidates import FittedCandidate
from .cross_validation import Score
from .refit import Fitted
from .selection_result import Rejection, typical

KEEPS = 0.8
"""Largest share of V beyond noise that may remain after an effect."""
PERIODS, RESOLVED, FEWEST = 2.0, 0.2, 4
"""Smallest number of mains periods in a record, longest sample period in mains periods, smallest number of records."""
STEADY = 0.3
"""Smallest ratio of the quartiles of the hum amplitude."""


def first_rejection(best: FittedCandidate, alone: Fitted | None) -> Rejection | None:
    """First reason to reject a fitted candidate; None if it passes all tests.

    Parameters
    ----------
    best : FittedCandidate
        Refit with the effect.
    alone : Fitted or None
        Refit without the effect; None if it diverges.
    """
    owed = np.inf if alone is None else alone.score.cost - best.score.cost
    if owed < LEAST_GAIN:
        return Rejection(best.name, f"it gains only {owed:.2f} over the model that was refitted without it")
    if best.name == MainsHum.name and not is_steady(best):
        return Rejection(best.name, "its amplitude depends on the drive, which mains hum does not")
    return None


def share_left(after: Score, before: Score, null: float) -> float:
    """Share of V beyond noise that remains; the worst record is ignored."""
    first, second = typical(before, after)
    return max(0.0, second - null) / max(first - null, 1e-12)


def bends_all_along(candidate: FittedCandidate) -> bool:
    """Whether a limit bends over more than the whole drive range, so that it is a curve and not a limit."""
    saturates = candidate.name == AmplifierSaturation.name
    return saturates and candidate.effect["corner"] > candidate.training_data.extent.span


def is_steady(candidate: FittedCandidate) -> bool:
    """Whether a hum has about the same amplitude in all records, as mains hum does not depend on the drive."""
    training_data, lines = candidate.training_data, 2 * candidate.training_data.nuisance.harmonics
    frequency = training_data.nuisance.hum_frequency or 0.0
    amplitudes = np.array(
        [
            np.hypot(found[-lines::2], found[1 - lines :: 2])
            for record, floor, found in zip(
                training_data.records, training_data.floors, candidate.fit.nuisances, strict=True
            )
            if np.isfinite(floor)
            and found.size >= lines
            and record.duration * frequency >= PERIODS
            and record.sample_period * frequency <= RESOLVED
        ]
    ).reshape(-1, lines // 2)
    if len(amplitudes) < FEWEST:
        return True
    strongest = amplitudes[:, int(np.argmax(np.median(amplitudes, axis=0)))]
    low, high = np.quantile(strongest, (0.25, 0.75))
    return bool(low > STEADY * high)
