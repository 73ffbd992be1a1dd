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

"""Rivals: the fitted explanations that are too likely to be excluded."""

from __future__ import annotations

from collections.abc import Mapping

from ..diagnosis import Diagnosis
from ..search.candidates import FittedCandidate
from .probabilities import NONE_OF_THESE, NOTHING


def rivals_of(found: Diagnosis | None, probabilities: Mapping[str, float], error_rate: float) -> list[FittedCandidate]:
    """The best fit of every effect that is still possible, best first.

    Empty if "nothing" or "none of these" is possible too: these cannot be simulated, so no drive can be chosen.

    Parameters
    ----------
    found : Diagnosis or None
        The last diagnosis.
    probabilities : mapping of str to float
        Probability of every explanation.
    error_rate : float
        Probability below which an explanation is excluded.
    """
    if found is None or found.selection is None or not found.selection.steps:
        return []
    likely = {name for name, p in probabilities.items() if p >= error_rate}
    last = {name.split(" + ")[-1] for name in likely}
    if last & {NOTHING, NONE_OF_THESE}:
        return []
    steps = found.selection.steps
    step = next((s for s in steps if len(last & {c.effect.public_name() for c in s.tried}) > 1), steps[0])
    fitted: dict[str, FittedCandidate] = {}
    for candidate in step.tried:
        name = candidate.effect.public_name()
        if isinstance(candidate, FittedCandidate) and name in last:
            fitted.setdefault(name, candidate)
    return list(fitted.values())
