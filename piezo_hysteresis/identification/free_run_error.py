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

"""Free-run error of a model: the error measure that the whole package reports.

The error of a phase is the RMS of measured minus simulated displacement, in per cent of the *range*: the peak-to-peak
of the measured displacement over the whole experiment. The paper's Table 1 uses the same measure.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..blocks.block import Array
from ..effects import MainsHum
from ..errors import IdentificationError
from ..model.model import Model
from ..record import CONDITIONING, Experiment, Record
from .fit.normal_equations import Nuisance, residuals
from .records.conditioning import with_conditioning

SINE = re.compile(r"sine_([0-9.]+)hz")
"""Phase name of a sine, with its frequency [Hz]."""


@dataclass(frozen=True, slots=True)
class Error:
    """Free-run error of one phase.

    Parameters
    ----------
    phase : str
        Phase name.
    index : int
        Number of the record in the experiment, from 0.
    frequency : float or None
        Drive frequency of a sine phase [Hz].
    size : int
        Number of samples.
    rms : float
        RMS of the residual [m].
    percent : float
        `rms` in % of the range of the experiment.
    largest : float
        Largest absolute residual [m].
    fit : float
        100·(1 − ‖e‖/‖y − mean y‖) [%]; NaN if the displacement is constant.
    has_known_start : bool
        False if the state of the stage at the first sample is not known: a conditioning phase, a truncated record.
    """

    phase: str
    index: int
    frequency: float | None
    size: int
    rms: float
    percent: float
    largest: float
    fit: float
    has_known_start: bool = True


@dataclass(frozen=True, eq=False, slots=True)
class Errors:
    """Free-run errors of a model on an experiment, record by record.

    Parameters
    ----------
    range : float
        Peak-to-peak of the measured displacement over the experiment [m].
    zero : float
        Constant added to the simulation before the comparison [m]; 0 if none was free for the whole experiment.
    rows : tuple of Error
        One error per record, in order.
    predicted, residuals : tuple of (n,) ndarray
        Simulated displacement with its offset, and measured minus simulated [m], per record.
    """

    range: float
    zero: float
    rows: tuple[Error, ...]
    predicted: tuple[Array, ...]
    residuals: tuple[Array, ...]

    @property
    def judged(self) -> tuple[Error, ...]:
        """Rows with a known initial state; all rows if there is none."""
        return tuple(row for row in self.rows if row.has_known_start) or self.rows

    @property
    def rms(self) -> float:
        """RMS over the judged records with equal weights [m]."""
        return float(np.sqrt(np.mean([row.rms**2 for row in self.judged])))

    @property
    def percent(self) -> float:
        """`rms` in % of the range."""
        return 100.0 * self.rms / self.range

    @property
    def largest(self) -> float:
        """Largest absolute residual of the judged records [m]."""
        return max(row.largest for row in self.judged)

    @property
    def by_frequency(self) -> dict[float, float]:
        """Error in % of range at every frequency [Hz] of the sine phases, as in the paper's Table 1."""
        found = sorted({row.frequency for row in self.rows if row.frequency is not None})
        return {f: float(np.sqrt(np.mean([r.percent**2 for r in self.rows if r.frequency == f]))) for f in found}

    @property
    def by_phase(self) -> dict[str, float]:
        """Error in % of range of every phase name; repetitions of a phase have equal weights."""
        names = dict.fromkeys(row.phase for row in self.rows)
        return {n: float(np.sqrt(np.mean([r.percent**2 for r in self.rows if r.phase == n]))) for n in names}


def drive_frequency(record: Record) -> float | None:
    """Frequency of a phase named ``sine_<f>hz`` [Hz], None for every other phase.

    >>> drive_frequency(Record([0.0], [0.0], 1e-3, phase="sine_0.5hz"))
    0.5
    """
    match = SINE.fullmatch(record.phase)
    return float(match[1]) if match else None


def errors(model: Model, experiment: Experiment, nuisance: Nuisance | None = None) -> Errors:
    """Free-run error of `model` on every record of `experiment`.

    Parameters
    ----------
    model : Model
        Model, simulated from rest; its state continues into records that continue the one before.
    experiment : Experiment
        Records, each at its own sample period.
    nuisance : Nuisance, optional
        Disturbances that are free in every record. Default: one constant for the whole experiment, because the zero of
        a displacement sensor is arbitrary; and mains hum in every record if the model contains hum, because its phase
        cannot be predicted.

    Returns
    -------
    Errors
        Errors, simulation and residual of every record.

    Raises
    ------
    IdentificationError
        If the displacement never changes.
    ModelError
        If a record is faster than the model.
    DivergenceError
        If the simulation diverges.
    """
    span = experiment.range
    if not span > 0.0:
        raise IdentificationError(
            f"displacement is {experiment[0].displacement[0]:g} m in every sample, expected a stage that moves; "
            "check the sensor and its column"
        )
    free_run, zero = model.free_run(experiment), 0.0
    if nuisance is None:
        means = np.array([np.mean(r.displacement - y) for r, y in zip(experiment, free_run, strict=True)])
        known = np.array([_has_known_start(r) for r in experiment])
        zero = float(means[known if known.any() else ~known].mean())
        nuisance = free_per_record(model, offset=False)
    pairs = zip(experiment, free_run, strict=True)
    left = [nuisance.removed_from(r.displacement - (y + zero), r) for r, y in pairs]
    predicted = [r.displacement - e for r, e in zip(experiment, left, strict=True)]
    rows = [_row(i, r, e, span) for i, (r, e) in enumerate(zip(experiment, left, strict=True))]
    return Errors(span, zero, tuple(rows), tuple(predicted), tuple(left))


def residuals_on(model: Model, records: Sequence[Record], wanted: Sequence[int], nuisance: Nuisance) -> list[Array]:
    """Residuals of the records `wanted` [m], in free run, without the disturbances that are free in every record.

    Other records are only simulated if one of these continues them. A model that diverges raises a DivergenceError.
    """
    kept = with_conditioning(records, wanted)
    left = dict(zip(kept, residuals(model, [records[i] for i in kept], nuisance), strict=True))
    return [left[i] for i in wanted]


def free_per_record(model: Model, *, offset: bool) -> Nuisance:
    """What is free in every record: the hum of a model that contains hum, and with `offset` the sensor zero."""
    return Nuisance(offset, model[MainsHum.name]["f"] if MainsHum.name in model else None)


def _has_known_start(record: Record) -> bool:
    return record.phase != CONDITIONING and not record.truncated


def _row(index: int, record: Record, residual: Array, span: float) -> Error:
    rms = float(np.sqrt(np.mean(residual**2)))
    deviation = float(np.std(record.displacement))
    return Error(
        phase=record.phase,
        index=index,
        frequency=drive_frequency(record),
        size=record.size,
        rms=rms,
        percent=100.0 * rms / span,
        largest=float(np.max(np.abs(residual))),
        fit=100.0 * (1.0 - rms / deviation) if deviation > 0.0 else float("nan"),
        has_known_start=_has_known_start(record),
    )
