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

from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from ...changes.group_fit import fit_groups
from ...changes.minute import Minute
from ...changes.recalibration_history import RecalibratedNumber, numbers_of
from ...model.model_file import dumps, loads
from ...model.model_parameters import model_hash
from ...online.change.baseline import Baseline
from ...online.voltage_history import DriveHistory
from ..runtime.fit_process import Outcome
from ..runtime.job_process import Report

_MINUTE, _BASELINE = "minute.npz", "baseline.npz"
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
    drive = minute.drive
    np.savez(
        folder / _MINUTE,
        rest=np.array([drive.rest_voltage, drive.start_time, drive.slow_period, drive.sample_period]),
        slow=drive.slow,
        full=drive.full,
        displacement=minute.displacement,
        asked=np.array([minute.offset, interval, statistic]),
        group=np.array(group),
    )
    baseline.save(folder / _BASELINE)


def recalibration(folder: Path, model: str, report: Report) -> RecalibrationOutcome:
    """Fit the changed group to the minute of samples in a folder."""
    report("reading", 0.0)
    with np.load(folder / _MINUTE, allow_pickle=False) as file:
        rest, start, slow_period, period = map(float, file["rest"])
        drive = DriveHistory(rest, start, slow_period, period, file["slow"], file["full"])
        offset, interval, statistic = map(float, file["asked"])
        minute, group = Minute(drive, file["displacement"], offset), str(file["group"])
    before, baseline = loads(model), Baseline.load(folder / _BASELINE)
    report("fitting", 0.1)
    fit = fit_groups(before, minute, baseline, group, interval)
    time = datetime.now(UTC).strftime("%Y-%m-%dT%H:%M:%SZ")
    after = replace(fit.model, provenance={**fit.model.provenance, "recalibrated": time})
    numbers = numbers_of(before, offset, fit, time, statistic, (model_hash(before), model_hash(after)))
    verdict = (
        f"{' and '.join(fit.groups)} recalibrated on {fit.duration:.0f} s: residual {1e9 * fit.before:.3g} nm before, "
        f"{1e9 * fit.after:.3g} nm after, {1e9 * fit.floor:.3g} nm in the baseline"
    )
    lines = (f"{n.parameter} {n.old:.6g} → {n.new:.6g} {n.unit} (95 %: {n.low:.6g} to {n.high:.6g})" for n in numbers)
    return RecalibrationOutcome(dumps(after), "\n".join(lines), verdict, fit.offset, numbers)
