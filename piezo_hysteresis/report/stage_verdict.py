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

"""Whether a model describes the stage of new records, in the words of `piezo validate` and `piezo recalibrate`."""

from __future__ import annotations

from ..identification.stage_check import StageCheck
from .words import describes, error_sentence


def can_be_trusted(check: StageCheck, percent: float) -> bool:
    """Whether a model with this error [% of range] describes the stage, as well as it is known to.

    The error of fitted records does not bound that of others.
    """
    return describes(percent) and (check.is_as_good or not check.unseen)


def stage_sentence(check: StageCheck, percent: float, cause: str) -> str:
    """Whether a model describes the stage.

    Parameters
    ----------
    check : StageCheck
        Its errors on the new records.
    percent : float
        Free-run error that is stated [% of range].
    cause : str
        End of the sentence about an error that is larger than the known one.

    Examples
    --------
    >>> stage_sentence(StageCheck(0.4, 0.5, 0.1), 0.4, ": the stage has changed.").split(", ")[-1]
    '5 times the largest that the model is known to have: the stage has changed.'
    """
    if check.is_as_good or not describes(percent):
        return error_sentence(percent)
    ratio = f"{check.largest:.3g} %, {check.largest / check.known:.2g} times the largest"
    after = "after its first full loop" if check.after_loop else "which also depends on what the stage did before it"
    one = f"in one record, {after},"
    if not check.unseen:
        return (
            f"{error_sentence(percent)} {one.capitalize()} it is {ratio} of the records that were fitted, of which "
            f"none was left out{cause}"
        )
    return (
        f"The model does not describe this stage as well as it is known to: its error in free run is {percent:.3g} % "
        f"of the range, and {one} {ratio} that the model is known to have{cause}"
    )
