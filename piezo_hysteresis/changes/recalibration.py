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

"""`recalibrate`: fits an old model of the same stage to new records, by gain, offset, loop height and lag only.

Records of one stage differ by about 0.5 % from one day to another. A model of many records with these four new numbers
predicts better than a new model of one new record. A stage that has not changed keeps its numbers: the error that the
model states counts as the floor, gain and loop height are expected to be nearly the old ones, and the lag changes only
if the records show it for certain.

New records seldom show what the stage did before them, and its hysteresis remembers that until the drive has been at
both ends of its range. The samples up to there are neither fitted nor part of the errors.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..effects import Offset
from ..errors import IdentificationError, ParameterError
from ..identification.fit.normal_equations import residuals
from ..identification.records.excitation_check import check_motion
from ..identification.records.noise import without_voltage_noise
from ..identification.records.noise_floor import floors, stroke
from ..identification.records.one_axis import one_axis
from ..identification.stage_check import StageCheck, check_stage, moving_after_a_loop, moving_in
from ..model.model import Model
from ..model.provenance import LARGEST, MOVING, known_error, knows_unseen_records, with_origin
from ..record import Experiment, Notice
from .change_kinds import ParameterChange
from .change_search import ChangeSearch
from .changed_model import changed_model
from .joint_fit import JointFit, fit_jointly

Array = NDArray[np.float64]

LARGEST_FACTOR = 10.0
"""Gain relative to that of the model, or its reciprocal, from which the records are not those of the same stage."""

LAG_OR_LOOP = "lag_or_loop_height"
"""Kind of the notice that the records hardly distinguish a lag from a loop height."""


@dataclass(frozen=True, eq=False, slots=True)
class Recalibration:
    """An old model with newly fitted parameters.

    Parameters
    ----------
    model : Model
        The new model. If its error is not smaller, the old model with the new offset.
    gain, loop_height : float
        Relative changes of the mean slope, and of the loop at the same slope [1]; 0 if the model has no loop.
    lag : float
        Change of the lag [s]; 0 if the records do not show one for certain.
    intervals_95 : mapping of str to (float, float)
        95 % intervals of the three, by name; infinite if the records have too few parts.
    offset : float
        Reading at zero displacement [m].
    before, after : float
        Free-run error with the zero fitted in every record [% of range].
    largest : float
        Largest error of one record with the new model [% of range].
    known : float
        The same of the old model, as it states it, or the noise floor of the records if it is larger [% of range]; 0 if
        it states none. A mean over kinds of drive is no measure for new records of one kind.
    notices : tuple of Notice
        What was corrected in the records, and what they hardly distinguish.
    after_loop : bool
        Whether the record with the largest error is judged after a full loop of the drive.
    """

    model: Model
    gain: float
    loop_height: float
    lag: float
    intervals_95: Mapping[str, tuple[float, float]]
    offset: float
    before: float
    after: float
    largest: float
    known: float
    notices: tuple[Notice, ...]
    after_loop: bool = True

    @property
    def is_as_good(self) -> bool:
        """Whether the new model is as good as the old one was."""
        return self.check.is_as_good

    @property
    def check(self) -> StageCheck:
        """The errors of the new model, and the known one of the old model."""
        return StageCheck(self.after, self.largest, self.known, knows_unseen_records(self.model), self.after_loop)


def recalibrate(model: Model, experiment: Experiment) -> Recalibration:
    """Fit gain, offset, loop height and lag of a model to new records.

    Parameters
    ----------
    model : Model
        Model identified earlier from the same stage.
    experiment : Experiment
        New records.

    Returns
    -------
    Recalibration
        New model and the four changes.

    Raises
    ------
    IdentificationError
        If the drive does not move in any record, the displacement is constant, or the changed parameters are beyond
        their bounds.
    ModelError
        If the records are faster than the model.
    RecordError
        If a record has several drives.
    """
    axes_notices = one_axis(experiment)
    quiet, noise_notices = without_voltage_noise(experiment)
    notices = (*axes_notices, *noise_notices)
    records, used = moving_after_a_loop(quiet.records)
    if not used and moving_in(quiet.records):
        raise IdentificationError(
            "recalibrate: the drive does not move after it has been at both ends of its range, so that all motion "
            "depends on what the stage did before these records; expected a further loop or step"
        )
    check_motion("recalibrate", [records[i] for i in used])
    least = floors(records)
    limits = np.maximum(least, known_error(model, MOVING)).tolist()
    search = ChangeSearch(model, records, used, limits)
    search.discount_steps(search.shaped("delay"))
    joint = fit_jointly(search)
    best, intervals = joint.account, joint.intervals_95
    session = search.session(best)
    change = ParameterChange("delay", best.size, intervals["lag"], (), best.cost, best.cost, session)

    def zeroed(candidate: Model) -> Model:
        bare = candidate.without(Offset.name)
        left = residuals(bare, records)
        old = candidate[Offset.name] if Offset.name in candidate else Offset()
        return bare.with_effect(old.with_values(y0=float(np.mean([np.mean(left[i]) for i in used]))))

    factor = 1.0 + session["gain"]
    beyond = f"recalibrate: the gain would have to be {factor:.3g} times that of the model"
    if not 1.0 / LARGEST_FACTOR < factor < LARGEST_FACTOR:
        raise IdentificationError(f"{beyond}, expected at most {LARGEST_FACTOR:g}; check stage, columns and units")
    try:
        fitted = zeroed(changed_model(model, change, records))
    except ParameterError as reason:
        raise IdentificationError(
            f"{beyond}, with a parameter beyond its bounds ({reason}); check stage, columns and units"
        ) from None

    before, after = (check_stage(m, quiet.records, known=model) for m in (model, fitted))
    kept = after.percent < before.percent
    new, errors = (fitted, after) if kept else (zeroed(model), before)
    return Recalibration(
        _with_errors(new, model, experiment, errors, stroke(records)),
        best.own["gain"] if kept else 0.0,
        search.stated("loop", best.own.get("loop", 0.0)) if kept else 0.0,
        best.size if kept else 0.0,
        {n: ends if kept else (min(ends[0], 0.0), max(ends[1], 0.0)) for n, ends in intervals.items()},
        new[Offset.name]["y0"],
        before.percent,
        errors.percent,
        errors.largest,
        errors.known,
        (*notices, *_unclear(joint, kept)),
        errors.after_loop,
    )


def _unclear(joint: JointFit, kept: bool) -> tuple[Notice, ...]:
    """What is said if the records hardly distinguish a lag from a loop height; `kept` says whether the fit is used."""
    if not joint.is_blurred:
        return ()
    taken = "neither was changed" if not kept else "the lag was changed" if joint.account.size else "the lag was kept"
    said = (
        "these records hardly distinguish a changed lag from a changed loop height, so that both intervals are wide; "
        f"{taken}. Records of a slow and of a fast drive together distinguish them"
    )
    return (Notice(LAG_OR_LOOP, said),)


def _with_errors(new: Model, old: Model, experiment: Experiment, errors: StageCheck, span: float) -> Model:
    """The new model, which states its error on the new records, and what the old one was known to have.

    On few records a model may be better than on others, so the error that counts as known does not become smaller. The
    largest one remains that of the old model: otherwise a model that is worse would be as good as it is known to be.
    """
    moving = max(0.01 * errors.percent * span, known_error(old, MOVING))
    largest = known_error(old, LARGEST) or 0.01 * errors.largest * span
    return with_origin(new, experiment, errors.percent, largest, moving, knows_unseen_records(old))
