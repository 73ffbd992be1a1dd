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

"""The next drive if two or three rivals remain: the one with the shortest expected time to decide between them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np

from ...blocks.block import Array
from ...errors import DivergenceError
from ...identification.fit.bounded_step import gauge
from ...identification.fit.form_uncertainty import PIECES
from ...identification.fit.normal_equations import grams
from ...identification.protocol.phases import ProtocolPhase
from ...identification.training.adjusted_numbers import adjusted_numbers
from ...identification.training.training_data import TrainingData
from ...model.model import Model
from ...record import Record
from ..search.candidates import FittedCandidate

ERROR_RATE, LONGEST = 0.005, 600.0
"""Defaults of the accepted probability of a wrong answer, and of the longest stage time [s]."""
ONE_RECORD = 4.0
"""Largest contribution of one record to the log-odds of two explanations. An error rate of 0.5 % needs 5.3."""
REPEATS = (1, 2, 4, 8)
"""Possible numbers of repeats of a drive before the next decision."""


@dataclass(frozen=True, slots=True)
class Separation:
    """Expected separation of two rivals by the best drive within the limits.

    Parameters
    ----------
    rivals : (str, str)
        The pair that is hardest to separate.
    drive : str
        Phase name of the drive.
    repeats : int
        Number of repeats.
    duration : float
        Stage time of all repeats [s].
    expected_z : float
        Expected separation in standard deviations, √(2 Λ) of the expected log-odds Λ.
    needed_z : float
        Separation that the accepted error rate still needs.
    """

    rivals: tuple[str, str]
    drive: str
    repeats: int
    duration: float
    expected_z: float
    needed_z: float

    @property
    def decides(self) -> bool:
        """Whether the drive is expected to decide."""
        return self.expected_z >= self.needed_z

    def numbers(self) -> dict[str, float]:
        """The drive and what it is expected to show, as in ``answer.json``."""
        return {
            "repeats": self.repeats,
            "duration_s": self.duration,
            "expected_z": self.expected_z,
            "needed_z": self.needed_z,
        }

    def answer(self) -> dict[str, Any]:
        """The next experiment as in ``answer.json``."""
        return {"phase": self.drive, "separates": list(self.rivals), "reason": self.sentence(), **self.numbers()}

    def sentence(self) -> str:
        """The separation in words."""
        first, second = (name.replace("_", " ") for name in self.rivals)
        times = "once" if self.repeats == 1 else f"{self.repeats} times"
        return (
            f"The best drive to separate {first} from {second} is '{self.drive}', played {times} in "
            f"{self.duration:.1f} s. It is expected to separate them by {self.expected_z:.1f} standard deviations, and "
            f"{self.needed_z:.1f} are needed."
        )


def z_of(log_odds: float) -> float:
    """Separation z in standard deviations that gives these log-odds on average, z²/2."""
    return float(np.sqrt(2.0 * max(log_odds, 0.0)))


def missing_log_odds(probabilities: Mapping[str, float], error_rate: float) -> float:
    """Additional log-odds between the two likeliest explanations that a certain answer needs.

    Parameters
    ----------
    probabilities : mapping of str to float
        Probability of every explanation.
    error_rate : float
        Accepted probability of a wrong answer.

    Examples
    --------
    >>> round(missing_log_odds({"creep": 0.5, "thermal_drift": 0.5}, 0.005), 2)
    5.29
    """
    first, second, *_ = (*sorted(probabilities.values(), reverse=True), 0.0)
    wanted = np.log((1.0 - error_rate) / error_rate)
    return float(max(wanted - np.log(first / max(second, 1e-300)), 0.0))


def expected_log_odds(distance: float, excess: float, repeats: int) -> float:
    """Log-odds that a drive is expected to add.

    Λ = r min(4, m/2 ln(1 + d²/V)), with the mean squared difference d² of the rivals in floors², the noise and the form
    uncertainty V = max(1, R²) in floors², and the number r of repeats.

    Parameters
    ----------
    distance : float
        d², at least 0.
    excess : float
        Mean R² of the better rival on the records so far.
    repeats : int
        Number of repeats.

    Examples
    --------
    >>> expected_log_odds(0.0, 1.0, 8)
    0.0
    >>> expected_log_odds(1e6, 1.0, 2)  # no record decides alone
    8.0
    """
    return float(repeats * min(ONE_RECORD, 0.5 * PIECES * np.log1p(distance / max(1.0, excess))))


def distances(
    first: Model, second: Model, training_data: TrainingData, drives: Mapping[str, Record]
) -> dict[str, float]:
    """Mean squared difference of two models on every drive, after the first has adjusted its parameters, in floors².

    It is 0 if one of the models diverges, because the drive is then far outside what the models describe.

    Parameters
    ----------
    first, second : Model
        Fitted models, one with each effect.
    training_data : TrainingData
        Recorded data, which constrain the common parameters.
    drives : mapping of str to Record
        Drives from rest; their displacement is not used.
    """
    free = adjusted_numbers(first, training_data)
    directions = gauge(first, free)
    products = grams(first, training_data.records, free, training_data.free_with(first))
    known: Array = sum(g.matrix / (g.size * f * f) for g, f in zip(products, training_data.floors, strict=True))
    prior = directions.T @ known[:-1, :-1] @ directions
    floor = float(np.min(training_data.floors))
    found = {}
    for name, record in drives.items():
        try:
            (difference,) = (a - b for a, b in zip(second.simulate(record), first.simulate(record), strict=True))
        except DivergenceError:
            found[name] = 0.0
            continue
        (gram,) = grams(first, [record], free, training_data.free_with(first), [difference[None, :]])
        total = gram.matrix[:-1, :-1] / (gram.size * floor * floor)
        q = len(free)
        cross = directions.T @ total[:q, q]
        inner = prior + directions.T @ total[:q, :q] @ directions
        scale = 1.0 / np.sqrt(np.maximum(np.diag(inner), 1e-300))
        solved = np.linalg.lstsq(inner * np.outer(scale, scale), scale * cross, rcond=1e-9)[0] * scale
        found[name] = max(0.0, float(total[q, q] - cross @ solved))
    return found


def best_drive(
    rivals: Sequence[FittedCandidate],
    drives: Sequence[ProtocolPhase],
    missing: float,
    time_left: float,
) -> tuple[tuple[ProtocolPhase, ...], Separation] | None:
    """The drive and its repeats with the shortest time to decide; None if no drive fits into the time.

    Every pair of rivals has to be separated, so a drive is judged by the pair that it separates least. If no drive
    decides, the one with the largest separation is returned, and its `decides` is False.

    Parameters
    ----------
    rivals : sequence of FittedCandidate
        Two or three rivals, best first.
    drives : sequence of ProtocolPhase
        Drives to choose from, inside the limits.
    missing : float
        Log-odds that the least separated pair still needs.
    time_left : float
        Remaining stage time [s].
    """
    records = {str(k): phase.as_record() for k, phase in enumerate(drives)}
    pairs = list(combinations(rivals, 2))
    by_pair = [distances(a.fit.model, b.fit.model, a.training_data, records) for a, b in pairs]
    options = []
    for k, phase in enumerate(drives):
        for repeats in REPEATS:
            if repeats * phase.duration > time_left:
                break
            log_odds = [
                expected_log_odds(found[str(k)], a.score.excess, repeats)
                for (a, _), found in zip(pairs, by_pair, strict=True)
            ]
            worst = int(np.argmin(log_odds))
            names = (pairs[worst][0].effect.public_name(), pairs[worst][1].effect.public_name())
            found_one = Separation(
                names, phase.name, repeats, repeats * phase.duration, z_of(log_odds[worst]), z_of(missing)
            )
            options.append((found_one, phase))
    if not options:
        return None
    deciding = [option for option in options if option[0].decides]
    if deciding:
        separation, phase = min(deciding, key=lambda option: option[0].duration)
    else:
        separation, phase = max(options, key=lambda option: option[0].expected_z)
    return (phase,) * separation.repeats, separation
