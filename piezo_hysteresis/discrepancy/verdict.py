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

"""`Verdict` and `Conclusion`: the result of a diagnosis, from the search and the gap, and its reason in words."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from enum import StrEnum

import numpy as np

from ..identification.fit.cross_validation import Score
from ..identification.fit.form_uncertainty import ADEQUACY
from ..identification.records.noise_floor import ADEQUATE
from ..record import Notice
from .gap import Gap
from .search.selection_result import Selection, share_for_a_name

FEWEST_RECORDS = 4
"""Fewest records from which test records can be taken and an effect can be named."""
TEST_INADEQUATE = 1.5
"""Error on the test records, in floors, above which something is missing, even if V of the training records is low."""

CHOSEN = (
    "the saved model has the structure that predicts best in cross-validation; it explains {} of the gap of the "
    "published model"
)
"""What is said of the saved model without a further effect, if no model was given."""
REFITTED = "the saved model is the given one, fitted to these records; it explains {} of the gap of the given model"
"""The same, if a refit of the given model is saved."""
KEPT = "the given model is saved unchanged, because a fit to these records predicts what was left out hardly better"
"""The same, if the given model is saved."""

DECIDED = " An extended model predicts rates, amplitudes and records better that were left out of the fit."
"""Added to the reason if the choice of the structure names the effects."""
MORE_MAY_BE_MISSING = " The time limit ended the search; more effects may be missing."
"""Added to the reason if effects are named although the time limit ended the search."""


class Verdict(StrEnum):
    """The three possible verdicts."""

    NAMED = "named"
    """Effects are named: they are missing in the model, or their parameter has changed."""
    NOTHING_MISSING = "nothing_missing"
    """The data show no missing effect."""
    UNKNOWN = "unknown"
    """Neither of the two."""


class Conclusion(StrEnum):
    """What the diagnosis found. The verdict and the headline of every report follow from it."""

    MISSING_EFFECT = "missing_effect"
    """The model does not contain one or more effects, which are named."""
    CHANGED_PARAMETER = "changed_parameter"
    """One parameter of the given model has changed, and it is named."""
    NOTHING_MISSING = "nothing_missing"
    """The error is at the noise floor."""
    NOTHING_CHANGED = "nothing_changed"
    """No effect is named, and the error of the given model is within its known error."""
    TIME_LIMIT = "time_limit"
    """The time limit ended the search before an effect was named."""
    INSUFFICIENT_DATA = "insufficient_data"
    """The data do not allow a verdict, or an effect does not improve the test records."""
    UNEXPLAINED_GAP = "unexplained_gap"
    """Something is missing that no effect of the catalogue explains."""

    @property
    def verdict(self) -> Verdict:
        """The verdict that follows from this conclusion.

        >>> str(Conclusion.CHANGED_PARAMETER.verdict), str(Conclusion.TIME_LIMIT.verdict)
        ('named', 'unknown')
        """
        if self in (Conclusion.MISSING_EFFECT, Conclusion.CHANGED_PARAMETER):
            return Verdict.NAMED
        return Verdict.NOTHING_MISSING if self is Conclusion.NOTHING_MISSING else Verdict.UNKNOWN


def is_explained(selection: Selection) -> bool:
    """Whether the added effects bring the error down to the floor, or explain enough of the gap for a name."""
    if not selection.accepted:
        return False
    before, left = selection.steps[0].before.excess, selection.score.excess
    return left <= ADEQUATE < before or selection.explained(selection.score) >= share_for_a_name(left)


def named_conclusion(selection: Selection, gap: Gap) -> tuple[Conclusion, str]:
    """The conclusion and its reason if the effects of the search are named."""
    accepted = [s.best.effect for s in selection.accepted]
    names = " and ".join(e.public_name() for e in accepted)
    explain = "explain" if len(accepted) > 1 else "explains"
    rest = (
        "the remaining error is at the noise floor"
        if gap.after <= np.sqrt(ADEQUATE) * gap.floor
        else f"an error of {gap.after / gap.floor:.1f} times the noise floor remains unexplained"
    )
    share, whole = (f"{100 * x:.0f} % of the gap" for x in (gap.explained_by_effects, gap.explained))
    if gap.refitted is not None and share != whole:
        share += f" that remains after a fit to these records ({gap.refitted.before:.3g} % of the range)"
    said = f"The model does not contain {names}, which {explain} {share}; {rest}."
    if (excess := selection.score.excess) > ADEQUATE:
        said += (
            f" The training records keep an error of {np.sqrt(excess):.1f} floors: the law of an effect may differ, "
            "and the intervals hold for this law only."
        )
    if not selection.in_time:
        said += MORE_MAY_BE_MISSING
    for name in (e.public_name() for e in accepted if not e.is_predicted_live()):
        said += (
            f" {name.replace('_', ' ').capitalize()} was fitted to each recording separately. It cannot be predicted "
            f"live, where an error of {gap.live:.2g} % of range remains."
        )
    return Conclusion.MISSING_EFFECT, said


def unnamed_conclusion(selection: Selection, falls: bool, gap: Gap) -> tuple[Conclusion, str]:
    """The conclusion and its reason if no effect is named.

    `falls` is False if the effects of the search were judged on the test records and did not reduce the gap there.
    """
    if not selection.in_time:
        return Conclusion.TIME_LIMIT, "No effect is named: the time limit ended the search before an answer was found."
    start = selection.steps[0].before if selection.steps else selection.score
    if start.excess <= ADEQUATE:
        if gap.after > TEST_INADEQUATE * gap.floor:
            times = f"the error on the test records is {gap.after / gap.floor:.1f} times the noise floor"
            said = f"No effect is named: the training records show no missing effect, but {times}."
            return Conclusion.INSUFFICIENT_DATA, said
        said = f"No effect is missing: the error is at the noise floor (at least {100 * ADEQUACY:g} % of the range)."
        return Conclusion.NOTHING_MISSING, said
    accepted = [s.best.effect.public_name() for s in selection.accepted]
    if accepted and not falls:
        names = " and ".join(accepted)
        said = f"No effect is named: {names} reduced the error on the training records, but not on the test records."
        return Conclusion.INSUFFICIENT_DATA, said
    message = ""
    if selection.steps:
        first = selection.steps[0]
        closest = " with ".join(accepted) or first.best.effect.public_name()
        share = 100 * selection.explained(selection.score if accepted else first.best.score)
        reason = first.rejected.get(first.best.name)
        why = f" ({reason})" if reason else ""
        message = f"; the closest effect is {closest}, which explains {share:.0f} % of the gap{why}"
    return Conclusion.UNEXPLAINED_GAP, f"No effect is named: no effect of the catalogue explains the gap{message}."


def conclusion_of_few(
    selection: Selection,
    decided: bool,
    before: Score,
    gap: Gap,
    count: int,
    several: bool,
    missing: Sequence[Notice],
    origin: str = CHOSEN,
) -> tuple[Conclusion, str]:
    """The conclusion and its reason.

    A small error of the extended model is no evidence that nothing is missing in the published one. One rate and one
    amplitude can be explained by wrong effects. `origin` says which model is saved, if it contains no further effect.
    """
    enough, is_adequate = count >= FEWEST_RECORDS, before.excess <= ADEQUATE
    explains = gap.falls and gap.explained >= share_for_a_name(selection.score.excess)
    if explains and (decided or (enough and several and is_explained(selection))):
        conclusion, reason = named_conclusion(selection, gap)
        return conclusion, reason + (DECIDED if decided else "")
    if not selection.in_time:
        return unnamed_conclusion(selection, gap.falls, gap)
    if enough and (several or is_adequate):
        judged = replace(gap, after=gap.before) if is_adequate else gap  # of the published model
        conclusion, reason = unnamed_conclusion(selection, gap.falls, judged)
        if is_adequate or conclusion is not Conclusion.NOTHING_MISSING:
            return conclusion, reason
    closed = f"{100 * gap.explained:.0f} %"
    names = [s.best.effect.public_name() for s in selection.accepted]
    if is_adequate:
        which = "published model" if origin == CHOSEN else "given model, fitted to these records,"
        message = f"the error of the {which} is at the noise floor, so the data cannot show further effects"
    elif names:
        message = (
            f"the closest effect is {' with '.join(names)}, which was added to the model; "
            f"the saved model explains {closed} of the gap"
        )
    else:
        message = origin.format(closed)
    records = ("one record" if count == 1 else f"{count} records") + ("" if several else " of one rate and amplitude")
    reason = "; ".join(
        (f"No effect is named, because {records} cannot distinguish effects", message, *(n.message for n in missing))
    )
    return Conclusion.INSUFFICIENT_DATA, f"{reason}."
