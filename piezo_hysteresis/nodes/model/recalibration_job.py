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

"""The job that the model node runs in another process: it fits the changed group to the last minute. No ROS."""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path

from ...changes.group_fit import fit_groups
from ...changes.minute import Minute
from ...changes.recalibration_history import RecalibratedNumber, numbers_of
from ...model.model_file import dumps, loads
from ...model.model_parameters import model_hash
from ...online.change.baseline import Baseline
from ..runtime.fit_process import Outcome
from ..runtime.job_process import Report

_MINUTE, _BASELINE, _ASKED = "minute.npz", "baseline.npz", "asked.json"
"""Files of a task."""


@dataclass(frozen=True, slots=True)
class RecalibrationOutcome(Outcome):
    """A recalibrated model.

    Parameters
    ----------
    offset : float
        Sensor minus model [m].
    numbers : tuple of RecalibratedNumber
        The changed numbers.
    """

    offset: float
    numbers: tuple[RecalibratedNumber, ...]


def write_task(folder: Path, minute: Minute, baseline: Baseline, group: str, interval: float, statistic: float) -> None:
    """Write the files that `recalibration` reads."""
    minute.save(folder / _MINUTE)
    baseline.save(folder / _BASELINE)
    (folder / _ASKED).write_text(json.dumps([group, interval, statistic]), encoding="utf-8")


def recalibration(folder: Path, model: str, report: Report) -> RecalibrationOutcome:
    """Fit the changed group to the minute of samples in a folder."""
    report("reading", 0.0)
    minute = Minute.load(folder / _MINUTE)
    group, interval, statistic = json.loads((folder / _ASKED).read_text(encoding="utf-8"))
    before, baseline = loads(model), Baseline.load(folder / _BASELINE)
    report("fitting", 0.1)
    fit = fit_groups(before, minute, baseline, group, interval)
    time = datetime.now(UTC).strftime("%Y-%m-%dT%H:%M:%SZ")
    after = replace(fit.model, provenance={**fit.model.provenance, "recalibrated": time})
    numbers = numbers_of(before, minute.offset, fit, time, statistic, (model_hash(before), model_hash(after)))
    verdict = (
        f"{' and '.join(fit.groups)} recalibrated on {fit.duration:.0f} s: residual {1e9 * fit.before:.3g} nm before, "
        f"{1e9 * fit.after:.3g} nm after, {1e9 * fit.floor:.3g} nm in the baseline"
    )
    lines = (f"{n.parameter} {n.old:.6g} → {n.new:.6g} {n.unit} (95 %: {n.low:.6g} to {n.high:.6g})" for n in numbers)
    return RecalibrationOutcome(dumps(after), "\n".join(lines), verdict, fit.offset, numbers)
