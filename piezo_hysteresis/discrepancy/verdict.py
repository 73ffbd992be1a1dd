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

"""Derives the verdict from the search and the gap, with the reason in one sentence."""

from __future__ import annotations

import numpy as np

from ..effects import ExtraResonance
from .diagnosis import Conclusion
from .gap import Gap
from .search.cross_validation import ADEQUATE
from .search.selection_result import Selection

FEWEST_RECORDS = 4
"""Fewest records from which test records can be taken and an effect can be named."""
FORESEEN, UNFORESEEN = 1.1, 1.5
"""Error on the test records in units of the floor. Up to the first value nothing is missing, even if V of the training
records is a little high. From the second value something is missing, even if V of the training records is low."""
NAMED, NAMED_FAR = 0.6, 0.75
"""Smallest explained fraction of the gap for a name, and the same if the remaining error is large."""
FAR = 10.0
"""V above which the remaining error is large: a similar effect of another family may explain as much of the gap."""
LINEAR_LEAVES = 2.0 * ADEQUATE
"""Largest V that a linear effect may leave. The dynamics are fitted together with it and explain the rest."""


def is_explained(selection: Selection) -> bool:
    """Whether the added effects explain enough of the gap for a name."""
    share = NAMED if selection.score.excess <= FAR else NAMED_FAR
    return bool(selection.accepted) and selection.explained(selection.score) >= share


def is_makeshift(selection: Selection) -> bool:
    """Whether a lag or a resonance leaves a gap. A real one leaves none; a substitute for poor dynamics does."""
    linear = any(s.best.effect.family == "lag" or s.best.name == ExtraResonance.name for s in selection.accepted)
    return linear and selection.score.excess > LINEAR_LEAVES


def not_predicted_live(name: str, live: float) -> str:
    """Message about an effect that is fitted to every recording separately; `live` in % of range."""
    return (
        f"{name.replace('_', ' ').capitalize()} was fitted to each recording separately. It cannot "
        f"be predicted live, where an error of {live:.2g} % of range remains."
    )


def conclusion_of(selection: Selection, named: bool, falls: bool, gap: Gap) -> tuple[Conclusion, str]:
    """What the search found, and the reason.

    Parameters
    ----------
    selection : Selection
        Every step of the search.
    named : bool
        Whether its effects are to be named.
    falls : bool
        Whether they reduce the gap on the test records.
    gap : Gap
        Free-run error before and after.
    """
    if not selection.in_time and not named:
        return Conclusion.TIME_LIMIT, "No effect is named: the time limit ended the search before an answer was found."
    names = " and ".join(s.best.effect.public_name() for s in selection.accepted)
    explain = "explain" if len(selection.accepted) > 1 else "explains"
    closed = selection.explained(selection.score)
    if named:
        rest = (
            "the remaining error is at the noise floor"
            if gap.after <= np.sqrt(ADEQUATE) * gap.floor
            else f"an error of {gap.after / gap.floor:.1f} times the noise floor remains unexplained"
        )
        said = f"The model does not contain {names}, which {explain} {100 * closed:.0f} % of the gap; {rest}."
        fitted = [s.best.effect.public_name() for s in selection.accepted if not s.best.effect.is_predicted_live()]
        if not selection.in_time:
            said += " The time limit ended the search; more effects may be missing."
        return Conclusion.MISSING_EFFECT, " ".join([said, *(not_predicted_live(name, gap.live) for name in fitted)])
    many = gap.unseen and len(gap.per_phase) >= FEWEST_RECORDS
    foreseen = many and gap.after <= FORESEEN * gap.floor and selection.score.excess <= 2.0 * ADEQUATE
    if not selection.accepted and (foreseen or selection.score.excess <= ADEQUATE):
        if gap.after > UNFORESEEN * gap.floor:
            message = f"the error on the test records is {gap.after / gap.floor:.1f} times the noise floor"
            return (
                Conclusion.INSUFFICIENT_DATA,
                f"No effect is named: nothing is missing on the training records, but {message}.",
            )
        return (
            Conclusion.NOTHING_MISSING,
            "No effect is missing: the error does not exceed the noise and the adequacy floor of 0.03 % of the range.",
        )
    if is_explained(selection) and is_makeshift(selection):
        message = (
            f"{names} {explain} only {100 * closed:.0f} % of the gap, and a linear effect that is really "
            "there explains all of it"
        )
        return Conclusion.UNEXPLAINED_GAP, f"No effect is named: {message}."
    if selection.accepted and not falls:
        return (
            Conclusion.INSUFFICIENT_DATA,
            f"No effect is named: {names} improves the training records, but not the test records.",
        )
    message = ""
    if selection.steps:
        closest = selection.steps[0].best
        share = 100 * selection.explained(closest.score)
        why = "".join(f" ({r.reason})" for r in selection.steps[0].rejected if r.name == closest.name)
        message = (
            f"; the closest effect is {closest.effect.public_name()}, which explains {share:.0f} % of the gap{why}"
        )
    return Conclusion.UNEXPLAINED_GAP, f"Something is missing that no effect of the catalogue explains{message}."
