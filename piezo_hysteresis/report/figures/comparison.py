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

"""`ModelComparison`: an experiment and the models that are compared with it; the last one is reported."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...discrepancy import Diagnosis
from ...errors import DivergenceError, IdentificationError
from ...identification.fit.normal_equations import Nuisance
from ...identification.free_run_error import Errors, errors, free_per_record
from ...identification.records.noise_floor import floors, noise_floors
from ...model.model import Model
from ...record import Experiment

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False, slots=True)
class ModelComparison:
    """The data of all figures of a report.

    Parameters
    ----------
    experiment : Experiment
        The measurement.
    models : mapping of str to Model
        Models by label, in the order in which effects were added; may be empty.
    errors : mapping of str to Errors
        Free-run errors of every model.
    noise : (r,) ndarray
        Noise of every record at its own sample period [m].
    floors : (r,) ndarray
        Noise floor of every record [m].
    bands : tuple of (n,) ndarray, optional
        Half of the 95 % prediction band of the reported model, per record [m]; None if it was not requested.
    """

    experiment: Experiment
    models: Mapping[str, Model]
    errors: Mapping[str, Errors]
    noise: Array
    floors: Array
    bands: tuple[Array, ...] | None = None

    @property
    def floor(self) -> float:
        """Noise floor of all judged records together, with equal weights [m]."""
        floors = self.floors if self.now is None else self.floors[[row.index for row in self.now.judged]]
        return float(np.sqrt(np.mean(floors**2)))

    @property
    def label(self) -> str | None:
        """Label of the reported model; None without a model."""
        return list(self.models)[-1] if self.models else None

    @property
    def model(self) -> Model | None:
        """The reported model."""
        return None if self.label is None else self.models[self.label]

    @property
    def now(self) -> Errors | None:
        """Errors of the reported model."""
        return None if self.label is None else self.errors[self.label]

    @property
    def before(self) -> Errors | None:
        """Errors of the first model; None if there is only one."""
        return self.errors[next(iter(self.models))] if len(self.models) > 1 else None

    def drawn(self) -> list[int]:
        """Indices of the records to draw: those with known initial state; all, if there is none or no model."""
        return list(range(len(self.experiment))) if self.now is None else [row.index for row in self.now.judged]

    def indices(self, *phases: str) -> list[int]:
        """Indices of the records whose phase name, or its first word, is one of `phases`."""
        return [i for i, r in enumerate(self.experiment) if r.is_named(*phases)]


def compare(
    experiment: Experiment,
    models: Mapping[str, Model] | None = None,
    nuisances: Mapping[str, Nuisance] | None = None,
    record_floors: Sequence[float] | None = None,
    with_band: bool = False,
) -> ModelComparison:
    """Simulate every model over the experiment.

    Parameters
    ----------
    experiment : Experiment
        The measurement.
    models : mapping of str to Model, optional
        Models by label; the last one is reported.
    nuisances : mapping of str to Nuisance, optional
        Disturbances that are free in every record, by label, as for `errors`; for other models one sensor zero is free.
    record_floors : sequence of float, optional
        Noise floor of every record [m], if a diagnosis has computed it.
    with_band : bool
        Whether the 95 % prediction band of the last model is computed, if the model has a covariance.
    """
    models, nuisances = dict(models or {}), nuisances or {}
    records = experiment.records
    noise = noise_floors(records)
    last = list(models.values())[-1] if models else None
    bands = None
    if with_band and last is not None and last.covariance is not None:
        bands = tuple(1.96 * sigma for sigma in last.standard_errors(records))
    return ModelComparison(
        bands=bands,
        experiment=experiment,
        models=models,
        errors={label: errors(model, experiment, nuisances.get(label)) for label, model in models.items()},
        noise=noise,
        floors=floors(records, noise) if record_floors is None else np.asarray(record_floors, dtype=float),
    )


def compare_diagnosis(found: Diagnosis) -> ModelComparison:
    """The experiment of a diagnosis, with the model before and, if an effect or a change was named, after it.

    The sensor zero of every record is free if it is in the gap. Without a model if one diverges on a record,
    or the displacement never changes.
    """
    models = {}
    if found.baseline is not None:
        models["before"] = found.baseline
    is_named = found.change is not None or (found.selection is not None and bool(found.selection.accepted))
    if is_named and found.model is not None and found.model is not found.baseline:
        models["after"] = found.model
    offset = found.gap is None or found.gap.free_zeros
    try:
        return compare(found.experiment, models, {n: free_per_record(m, offset=offset) for n, m in models.items()})
    except (DivergenceError, IdentificationError):
        return compare(found.experiment)
