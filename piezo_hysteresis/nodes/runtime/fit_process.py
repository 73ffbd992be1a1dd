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

"""`FitProcess`: runs a fit in its own process. No ROS."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import TypeVar

from .job_process import Exchange, JobProcess, Report


@dataclass(frozen=True, slots=True)
class Outcome:
    """Result of a fit.

    Parameters
    ----------
    model : str
        Text of the model file.
    summary : str
        Result with its uncertainties and warnings, several lines.
    verdict : str
        One line.
    conclusion : str
        What a diagnosis found, in one stable word (`discrepancy.Conclusion`); empty for other jobs.
    """

    model: str
    summary: str
    verdict: str
    conclusion: str = field(default="", kw_only=True)


Found = TypeVar("Found", bound=Outcome)
Job = Callable[[Path, str, Report], Found]
"""Function of the path of the data, the text of the present model, and a callback for progress."""


class FitProcess(JobProcess[Found]):
    """One fit, from its start to its outcome. Its process ends when this process ends.

    Parameters
    ----------
    job : callable
        A function of a module, so that the other process finds it.
    path : Path
        Of the data.
    model : str
        Text of a model file, or empty.
    """

    def __init__(self, job: Job[Found], path: Path, model: str = "") -> None:
        super().__init__("fit", _fit, job, path, model)


def _fit(exchange: Exchange, job: Job[Found], path: Path, model: str) -> Found:
    return job(path, model, exchange.report)
