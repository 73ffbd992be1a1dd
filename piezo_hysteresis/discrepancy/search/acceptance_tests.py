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

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy

from ...effects import AmplifierSaturation, MainsHum
from .candidate_refits import LEAST_GAIN
from .candidates import FittedCandidate
from .cross_validation import Score
from .refit import Fitted
from .selection_result import Rejection, typical

PERIODS, RESOLVED, FEWEST = 2.0, 0.2, 4
"""Smallest number of mains periods in a record, longest sample period in mains periods, smallest number of records."""
STEADY = 0.3
"""Smallest ratio of the quartiles of the hum amplitude."""
SEEN = 0.5
"""Smallest visible change of a record, in units of its floor."""


DECISIVE = 0.5
"""Gain over the model refitted without the effect from which the test of its off values is not needed."""


@dataclass(frozen=True, eq=False, slots=True)
class Trial:
    """A fitted candidate before the acceptance tests.

    Parameters
    ----------
    best : FittedCandidate
        Refit with the effect.
    alone : Fitted or None
        Refit without the effect; None if it diverges.
    null : float
        V of a perfect model.
    keeps : float
        Largest share of V beyond noise that may remain.
    """

    best: FittedCandidate
    alone: Fitted | None
    null: float
    keeps: float

    @property
    def owed(self) -> float:
        """Gain that is due to the effect alone; 0 if there is no model without it."""
        return 0.0 if self.alone is None else self.alone.score.cost - self.best.score.cost

    def rejection(self, reason: str) -> Rejection:
        """Rejection of the candidate, with a reason."""
        return Rejection(self.best.name, reason)


AcceptanceTest = Callable[[Trial], Rejection | None]
"""Returns the reason against an effect that improves the prediction, or None."""


def share_left(after: Score, before: Score, null: float) -> float:
    """Share of V beyond noise that remains; the worst record is ignored."""
    first, second = typical(before, after)
    return max(0.0, second - null) / max(first - null, 1e-12)


def gains_by_itself(trial: Trial) -> Rejection | None:
    """Rejects an effect if a refit without it improves the model as much."""
    alone = trial.alone
    if alone is None:
        return None
    is_owed = trial.owed >= LEAST_GAIN
    if is_owed and share_left(trial.best.score, alone.score, trial.null) <= trial.keeps:
        return None
    return trial.rejection(f"it gains only {trial.owed:.2f} over the model that was refitted without it")


def is_not_off(trial: Trial) -> Rejection | None:
    """Rejects an effect with a small gain if all its parameters may have their off values."""
    if trial.owed >= DECISIVE or not may_be_off(trial.best):
        return None
    return trial.rejection("its parameters do not differ significantly from their off values")


def can_be_seen(trial: Trial) -> Rejection | None:
    """Rejects an effect that changes no record visibly."""
    return None if is_seen(trial.best) else trial.rejection("it changes no record by more than half its floor")


def limits_the_drive(trial: Trial) -> Rejection | None:
    """Rejects a limit that bends over the whole drive range."""
    bends = bends_all_along(trial.best)
    return (
        trial.rejection("its bend is wider than the drive range, so that it is a curve and not a limit")
        if bends
        else None
    )


def ignores_the_drive(trial: Trial) -> Rejection | None:
    """Rejects a hum whose amplitude depends on the drive."""
    if trial.best.name != MainsHum.name or is_steady(trial.best):
        return None
    return trial.rejection("its amplitude depends on the drive, which mains hum does not")


ACCEPTANCE_TESTS: tuple[AcceptanceTest, ...] = (
    gains_by_itself,
    is_not_off,
    can_be_seen,
    limits_the_drive,
    ignores_the_drive,
)
"""The tests in order; the first rejection is reported."""


def first_rejection(trial: Trial) -> Rejection | None:
    """First rejection of a fitted candidate; None if it passes all tests."""
    return next((found for test in ACCEPTANCE_TESTS if (found := test(trial)) is not None), None)


def is_seen(candidate: FittedCandidate) -> bool:
    """Whether the effect changes any record visibly. Hum, which is free in every record, has its own test.

    A constant change that is the same in all records is the zero of the sensor.
    """
    training_data, model = candidate.training_data, candidate.fit.model
    with_it, without_it = (
        model.free_run(training_data.records),
        model.without(candidate.name).free_run(training_data.records),
    )
    changes = [first - second for first, second in zip(with_it, without_it, strict=True)]
    counted = [(c, floor) for c, floor in zip(changes, training_data.floors, strict=True) if np.isfinite(floor)]
    means = np.array([c.mean() for c, _ in counted])
    zeros = means if training_data.nuisance.offset else np.full(means.size, means.mean())
    return candidate.name == MainsHum.name or any(
        np.sqrt(np.mean((c - zero) ** 2)) > SEEN * floor for (c, floor), zero in zip(counted, zeros, strict=True)
    )


def may_be_off(candidate: FittedCandidate) -> bool:
    """Whether all parameters of the effect may have their off values: Wald test with the other parameters held.

    Time constants and exponents have no off value. They are held, so their correlation with a size does not matter.
    """
    fitted = candidate.fit
    errors, rows = fitted.standard_errors, fitted.model.row
    own = [n for n in fitted.names if n.startswith(f"{candidate.name}.")]
    if all(rows(n).off is None for n in own):
        return False
    measured = sorted((n for n in own if errors[n] > 0.0), key=lambda n: rows(n).off is None)
    off = np.array([(fitted.values[n] - value) / errors[n] for n in measured if (value := rows(n).off) is not None])
    at, scale, k = [fitted.names.index(n) for n in measured], np.array([errors[n] for n in measured]), off.size
    spread = fitted.covariance[np.ix_(at, at)] / np.outer(scale, scale)
    spread = spread[:k, :k] - spread[:k, k:] @ np.linalg.pinv(spread[k:, k:], hermitian=True) @ spread[k:, :k]
    return bool(off @ np.linalg.pinv(spread, rcond=1e-9, hermitian=True) @ off < scipy.stats.chi2.ppf(0.95, max(1, k)))


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
