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

"""Probability of every explanation after each decision of a live diagnosis."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ...discrepancy.choice.update import percent
from .table import Table

MOST = 6
"""Largest number of explanations shown."""


def shown_explanations(live: Mapping[str, Any], most: int = MOST) -> list[str]:
    """Explanations with the largest probabilities at any time, largest first; `live` as in ``answer.json``."""
    highest: dict[str, float] = {}
    for update in live["probabilities"]:
        for name, p in update["probabilities"].items():
            highest[name] = max(highest.get(name, 0.0), p)
    return sorted(highest, key=lambda name: -highest[name])[:most]


def probability_table(live: Mapping[str, Any]) -> Table:
    """One row for each decision.

    Parameters
    ----------
    live : mapping
        The part ``live`` of the answer.
    """
    names = shown_explanations(live)
    rows = tuple(
        (
            f"{update['time_s']:.1f}",
            update["played"],
            *(percent(update["probabilities"].get(name, 0.0)) for name in names),
        )
        for update in live["probabilities"]
    )
    header = ("stage time [s]", "played", *(name.replace("_", " ") for name in names))
    numeric = frozenset({0, *range(2, 2 + len(names))})
    caption = (
        f"{live['reason']} “None of these” is an effect that the catalogue does not contain. “creep + none of these” "
        "is creep and one such effect."
    )
    return Table("Probability of each explanation", header, rows, caption, numeric)
