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

"""`Work`: the task for every recording: identify, validate or diagnose."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from typing import Protocol

from ..discrepancy import diagnose
from ..effects import HYSTERESIS, OPERATORS
from ..errors import ParameterError
from ..identification.free_run_error import errors, free_per_record
from ..identification.identified_range import outside
from ..identification.identify import identify
from ..identification.records.comparable import comparable
from ..identification.records.noise_floor import floors, noise_floors
from ..model import model_file
from ..record import Experiment
from ..report.words import POOR, USELESS
from .work_result import WorkResult, fitted_parameters


class Work(Protocol):
    """A task: a function of an experiment that can be sent to another process."""

    @property
    def name(self) -> str:
        """Name of the task, one word."""

    def settings(self) -> str:
        """Everything that influences the result besides data and code, as text."""

    def __call__(self, experiment: Experiment) -> WorkResult:
        """The result for an experiment. If it raises an error, the row contains its message."""


@dataclass(frozen=True, slots=True)
class Identify:
    """Identifies a model from every recording, as `piezo identify` does.

    Parameters
    ----------
    hysteresis : str
        Name of the hysteresis operator, one of `effects.OPERATORS`.
    """

    hysteresis: str = HYSTERESIS.name
    name = "identify"

    def settings(self) -> str:
        return f"identify {self.hysteresis}"

    def __call__(self, experiment: Experiment) -> WorkResult:
        found = identify(experiment, hysteresis=OPERATORS[self.hysteresis], memory=True)
        fit = found.fit
        return WorkResult(
            verdict=described(found.free_run_percent) if fit.converged else "not_converged",
            effects=tuple(e.name for e in found.model.effects),
            converged=fit.converged,
            error=found.free_run_error,
            error_percent=found.free_run_percent,
            parameters=fitted_parameters(fit),
            notices=found.notices,
            model=model_file.dumps(found.model),
        )


@dataclass(frozen=True, slots=True)
class Validate:
    """Compares every recording with one model in free run, as `piezo validate` does.

    Parameters
    ----------
    model : str
        Text of the model file.
    """

    model: str
    name = "validate"

    def settings(self) -> str:
        return f"validate {_hash(self.model)}"

    def __call__(self, experiment: Experiment) -> WorkResult:
        model = model_file.loads(self.model)
        known, conditioned = comparable(experiment)
        found = errors(model, known, free_per_record(model, offset=True))
        records = known.records
        floor = floors(records, noise_floors(records))
        judged = [floor[row.index] ** 2 for row in found.judged]
        return WorkResult(
            verdict=described(found.percent),
            effects=tuple(e.name for e in model.effects),
            error=found.rms,
            error_percent=found.percent,
            floor_percent=100.0 * float(sum(judged) / len(judged)) ** 0.5 / found.range,
            notices=(*experiment.notices, *conditioned, *outside(model, known)),
        )


@dataclass(frozen=True, slots=True)
class Diagnose:
    """Names the effect that is missing in every recording, as `piezo diagnose` does.

    Parameters
    ----------
    model : str, optional
        Text of the model file with which the search begins; empty to identify a model first.
    """

    model: str = ""
    name = "diagnose"

    def settings(self) -> str:
        return f"diagnose {_hash(self.model)}"

    def __call__(self, experiment: Experiment) -> WorkResult:
        found = diagnose(experiment, model_file.loads(self.model) if self.model else None, cores=1)
        gap = found.gap
        return WorkResult(
            verdict=str(found.verdict),
            effects=found.names,
            converged=None if found.fit is None else found.fit.converged,
            error=None if gap is None else gap.after / 100.0 * found.experiment.range,
            error_percent=None if gap is None else gap.after,
            before_percent=None if gap is None else gap.before,
            floor_percent=None if gap is None else gap.floor,
            parameters=fitted_parameters(found.fit),
            notices=found.experiment.notices,
            model=None if found.model is None else model_file.dumps(found.model),
        )


TASKS = (Identify.name, Validate.name, Diagnose.name)
"""Names of the tasks that `piezo fleet` offers."""


def work_for(task: str, model: str = "", hysteresis: str = HYSTERESIS.name) -> Work:
    """The work of a task.

    Parameters
    ----------
    task : str
        One of `TASKS`.
    model : str
        Text of a model file: required for ``validate``, optional for ``diagnose``, not allowed for ``identify``.
    hysteresis : str
        Name of the hysteresis operator to identify.

    Returns
    -------
    Work

    Raises
    ------
    ParameterError
        If there is no such task, or the arguments do not fit the task.
    """
    if task == Identify.name and not model:
        return Identify(hysteresis)
    if task == Validate.name and model:
        return Validate(model)
    if task == Diagnose.name:
        return Diagnose(model)
    if task not in TASKS:
        raise ParameterError(f"task: got '{task}', expected one of {', '.join(TASKS)}")
    expected = "no model" if task == Identify.name else "a model to compare with"
    raise ParameterError(f"task {task}: got {'a model' if model else 'no model'}, expected {expected}")


def described(percent: float) -> str:
    """How well a model describes a stage, in one word, from its free-run error [% of range].

    The limits are `POOR` and `USELESS`. An error that is not a number gives ``not_described``.

    >>> described(0.1), described(5.0), described(126.0)
    ('described', 'poor', 'not_described')
    """
    if not percent < USELESS:
        return "not_described"
    return "poor" if percent > POOR else "described"


def _hash(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()[:16]
