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

"""`provenance`: the origin of the values of a model, as its file states it."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import replace
from datetime import UTC, datetime

import numpy as np

from ..record import Experiment
from .model import Model

LARGEST = "largest_record_error"
"""Key of the largest error of one record. The free-run error is a mean over kinds of drive, and one kind has more."""


MOVING = "moving_record_error"
"""Key of the free-run error over the records in which the drive moves. `free_run_error` may be a mean with rests."""


UNSEEN = "unseen_records"
"""Key of whether one of these errors is of a record that was not fitted. Errors of fitted records are usually less."""


def record_errors(largest: float, moving: float, unseen: bool) -> Mapping[str, str]:
    """The largest RMS free-run error of a single record, and that over the records in which the drive moves [m].

    `unseen` says whether a record among them was not fitted.
    """
    stated = {LARGEST: repr(float(f"{largest:.6g}")), MOVING: repr(float(f"{moving:.6g}"))}
    return {**stated, UNSEEN: "yes" if unseen else "no"}


def known_error(model: Model, key: str) -> float:
    """An error that a model states, `LARGEST` or `MOVING` [m]; if it states the mean error alone, that; else 0."""
    return float(model.provenance.get(key, model.provenance.get("free_run_error", "0")))


def provenance(experiment: Experiment, error: float, percent: float) -> Mapping[str, str]:
    """Source, date and hash of the data, and the free-run error reached.

    Parameters
    ----------
    experiment : Experiment
        What was fitted.
    error : float
        Rms of the free-run error on held-out data [m].
    percent : float
        The same in per cent of the displacement range.
    """
    return {
        "source": experiment.source,
        "date": datetime.now(UTC).strftime("%Y-%m-%dT%H:%M:%SZ"),
        "data_hash": data_hash(experiment),
        "free_run_error": repr(float(f"{error:.6g}")),
        "free_run_error_percent": repr(float(f"{percent:.6g}")),
    }


def knows_unseen_records(model: Model) -> bool:
    """Whether the errors that a model states include that of a record that was not fitted."""
    return model.provenance.get(UNSEEN) == "yes"


def with_origin(
    model: Model, experiment: Experiment, percent: float, largest: float, moving: float, unseen: bool
) -> Model:
    """The model with the origin of its values and its errors in the provenance; what else it states stays.

    Parameters
    ----------
    model : Model
        The model.
    experiment : Experiment
        What was fitted.
    percent : float
        Free-run error in % of the range of the experiment.
    largest, moving : float
        Largest error of a record, and that over the records in which the drive moves [m].
    unseen : bool
        Whether a record among them was not fitted.
    """
    origin = provenance(experiment, 0.01 * percent * experiment.range, percent)
    return replace(model, provenance={**model.provenance, **origin, **record_errors(largest, moving, unseen)})


def data_hash(experiment: Experiment) -> str:
    """``sha256:`` and 16 digits of phase names, sample periods, voltages and displacements."""
    digest = hashlib.sha256()
    for record in experiment:
        digest.update(f"{record.phase} {record.sample_period!r} {record.size}\n".encode())
        digest.update(np.ascontiguousarray(record.voltage, dtype="<f8").tobytes())
        digest.update(np.ascontiguousarray(record.displacement, dtype="<f8").tobytes())
    return "sha256:" + digest.hexdigest()[:16]
