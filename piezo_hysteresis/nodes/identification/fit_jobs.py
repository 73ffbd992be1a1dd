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

"""The jobs that the identification node runs in another process: a fit, or a diagnosis. No ROS."""

from __future__ import annotations

from pathlib import Path

from ...discrepancy.diagnose import diagnose
from ...errors import IdentificationError
from ...identification.identify import identify
from ...model.model_file import dumps, loads
from ...recording import read
from ...report.json_file import write_json
from ..runtime.fit_process import Outcome
from ..runtime.job_process import Report


def identification(path: Path, model: str, report: Report) -> Outcome:
    """Identify the model of a recorded experiment; the present model is not used."""
    found = identify(read(path), progress=report)
    verdict = f"free-run error {found.free_run_percent:.3g} % of range ({found.free_run_error * 1e9:.3g} nm)"
    return Outcome(dumps(found.model), str(found), verdict)


def diagnosis(path: Path, model: str, report: Report) -> Outcome:
    """Diagnose the present model, or a new one if there is none, and extend it; writes ``answer.json``."""
    found = diagnose(read(path), loads(model) if model else None, progress=report)
    folder = path if path.is_dir() else path.parent
    model_file = "" if found.model is None else str(folder / "diagnosis.yaml")
    write_json(str(folder / "answer.json"), found.answer(model_file))
    if found.model is None:
        raise IdentificationError(found.reason)
    return Outcome(
        dumps(found.model), found.summary(), f"{found.verdict}: {found.reason}", conclusion=str(found.conclusion)
    )
