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

"""`Update`: the probabilities after some phases. `End`: the reason why a live diagnosis has ended."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum


class End(StrEnum):
    """Why a live diagnosis has ended."""

    SURE = "sure"
    """One explanation has at least the probability 1 − error rate, and the rules of the diagnosis agree with it."""
    UNDECIDABLE = "undecidable"
    """No drive within the limits and the remaining time is expected to separate the rivals."""
    EXHAUSTED = "exhausted"
    """The planned phases that fit into the stage time were played, and no explanation is certain."""


@dataclass(frozen=True, slots=True)
class Update:
    """Probabilities of the explanations after some phases.

    Parameters
    ----------
    time : float
        Stage time so far [s].
    played : str
        Phases that were played last.
    probabilities : dict of str to float
        Probability by explanation, largest first; they sum to one.
    """

    time: float
    played: str
    probabilities: dict[str, float]

    @property
    def likeliest(self) -> str:
        """The explanation with the highest probability."""
        return next(iter(self.probabilities))

    def sentence(self) -> str:
        """The three likeliest explanations, for status lines."""
        three = list(self.probabilities.items())[:3]
        return ", ".join(f"{name} {percent(p)}" for name, p in three)


def percent(probability: float) -> str:
    """A probability in %; a value near 1 is not rounded to 100 %.

    >>> percent(0.25), percent(0.99999)
    ('25.0 %', '> 99.9 %')
    """
    return f"{100.0 * probability:.1f} %" if probability < 0.9995 else "> 99.9 %"
