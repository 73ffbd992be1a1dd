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

"""`check_stage`: whether a model describes new records of its stage as well as it is known to.

`piezo validate` and `piezo recalibrate` judge by it. New records seldom show what the stage did before them, and its
hysteresis remembers that until the drive has been at both ends of its range; the samples up to there do not count. The
largest error of one record counts, because a mean over kinds of drive is no measure for records of one kind.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..model.model import Model
from ..model.provenance import LARGEST, known_error, knows_unseen_records
from ..record import CONDITIONING, Record
from .fit.normal_equations import residuals
from .free_run_error import free_per_record
from .records.conditioning_split import AT_THE_END, conditioning_length, covers
from .records.excitation_check import SHORTEST_RECORD, check_motion, moves
from .records.noise import travel
from .records.noise_floor import floors, stroke

Array = NDArray[np.float64]

EXCESS = 1.3
"""Ratio of the RMS error to the known one from which a model is not as good as before."""


def is_as_good(error: float, known: float) -> bool:
    """Whether a model with this RMS error is as good as it was with the known one; both in the same unit."""
    return error <= EXCESS * known


@dataclass(frozen=True, slots=True)
class StageCheck:
    """Errors of a model on new records, and the known one.

    Parameters
    ----------
    percent : float
        Free-run error over the records in which the drive moves, with a zero fitted in every record [% of range].
    largest : float
        Largest error of one of them [% of range].
    known : float
        The same as the model states it, or the noise floor of the records if it is larger [% of range]; 0 if it states
        none.
    unseen : bool
        Whether a record that was not fitted is part of the known error, so that it holds for other records.
    after_loop : bool
        Whether the record with the largest error is judged after a full loop of the drive; else the state at its start
        is assumed.
    """

    percent: float
    largest: float
    known: float
    unseen: bool = True
    after_loop: bool = True

    @property
    def is_as_good(self) -> bool:
        """Whether the model is as good as it is known to be, by the criterion of the recalibration while running."""
        return not self.known or is_as_good(self.largest, self.known)


def check_stage(model: Model, records: Sequence[Record], known: Model | None = None) -> StageCheck:
    """The errors of a model on new records of its stage.

    Parameters
    ----------
    model : Model
        The model.
    records : sequence of Record
        New records, in order.
    known : Model, optional
        Model that states the known error; by default the same one.

    Raises
    ------
    IdentificationError
        If the stage or its drive does not move.
    """
    cut, used = moving_after_a_loop(records)
    if not (some := bool(used)):  # a step or a ramp that only holds afterwards
        cut, used = tuple(records), moving_in(records)
    check_motion("validate", [cut[i] for i in used])
    single, span = record_errors_of(model, cut, used), stroke(cut)
    reference = model if known is None else known
    stated = known_error(reference, LARGEST)
    floor = float(np.sqrt(np.mean(floors(cut)[used] ** 2)))
    rms = float(np.sqrt(np.mean(single**2)))
    return StageCheck(
        100.0 * rms / span,
        100.0 * float(single.max()) / span,
        100.0 * max(stated, floor) / span if stated else 0.0,
        knows_unseen_records(reference),
        some and not assumes_a_state(cut, used[int(np.argmax(single))]),
    )


def record_errors_of(model: Model, records: Sequence[Record], used: Sequence[int]) -> Array:
    """RMS error of every used record with its own zero [m]."""
    left = residuals(model, records, free_per_record(model, offset=True))
    return np.asarray(np.sqrt([np.mean(left[i] ** 2) for i in used]))


def moving_in(records: Sequence[Record]) -> list[int]:
    """Indices of the records in which the drive moves from a known state; those of unknown state if there are none.

    Records of fewer than `SHORTEST_RECORD` are left out: they show no lag.
    """
    long = [i for i, r in enumerate(records) if r.size >= SHORTEST_RECORD and r.phase != CONDITIONING]
    used = [i for i in long if moves(records[i])]
    return [i for i in used if not records[i].truncated] or used


def moving_after_a_loop(records: Sequence[Record]) -> tuple[tuple[Record, ...], list[int]]:
    """The records after a loop, and those in which the drive moves; none if it only reaches the end of its range."""
    cut = after_a_loop(records)
    used = moving_in(cut)
    way = 2.0 * AT_THE_END * max((travel(records[i]) for i in moving_in(records)), default=0.0)
    return cut, used if any(travel(cut[i]) > way for i in used) else []


def after_a_loop(records: Sequence[Record]) -> tuple[Record, ...]:
    """The records, cut where the drive has been at both ends of its range, so that the past no longer matters."""
    cut: list[Record] = []
    lead: list[Record] = []
    for record in records:
        lead = lead if record.continues else []
        samples = 0 if lead and covers(lead, record) else conditioning_length(record)
        cut += [replace(record[:samples], phase=CONDITIONING), record[samples:]] if samples else [record]
        lead = [*lead, record]
    return tuple(cut)


def assumes_a_state(cut: Sequence[Record], index: int) -> bool:
    """Whether the drive reaches an end of its range so late that `after_a_loop` has kept the beginning of the record.

    The error of this record then contains what the stage still remembered from before.
    """
    record, lead = cut[index], index
    while lead > 0 and cut[lead].continues:
        lead -= 1
    return float(np.ptp(record.voltage)) > 0.0 and not (lead < index and covers(cut[lead:index], record))
