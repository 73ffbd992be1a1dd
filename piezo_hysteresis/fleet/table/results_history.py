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

"""Reads the results of a folder as the history that the report of a fleet draws."""

from __future__ import annotations

from collections import defaultdict
from pathlib import Path

import numpy as np

from ...errors import RecordingError
from ...report.fleet.history import FleetHistory, ParameterSeries
from .results import read_results

COLUMNS = [
    "recording", "task", "stage", "status", "verdict", "error", "recorded_at", "free_run_error_percent",
    "floor_percent", "severe_findings", "parameters",
]  # fmt: skip
"""Columns that the report needs."""


def results_history(folder: Path, task: str) -> FleetHistory:
    """The rows of one task, sorted by the time of the recording.

    Parameters
    ----------
    folder : Path
        Folder written by `Results`.
    task : str
        Name of the task.

    Returns
    -------
    FleetHistory

    Raises
    ------
    RecordingError
        If there are no such rows.
    """
    rows = [row for row in read_results(folder, COLUMNS).to_pylist() if row["task"] == task]
    if not rows:
        raise RecordingError(f"{folder}: got no rows of the task {task}, expected some; run piezo fleet --task {task}")
    times = np.array(
        ["NaT" if row["recorded_at"] is None else row["recorded_at"].replace(tzinfo=None).isoformat() for row in rows],
        dtype="datetime64[us]",
    )
    order = np.argsort(times, kind="stable")
    rows, times = [rows[i] for i in order], times[order]
    found: dict[str, list[tuple[int, dict[str, object]]]] = defaultdict(list)
    for i, row in enumerate(rows):
        for parameter in row["parameters"] or ():
            if "[" not in parameter["name"] and parameter["value"] is not None:
                found[parameter["name"]].append((i, parameter))
    return FleetHistory(
        source=str(folder),
        task=task,
        recording=_texts(rows, "recording"),
        stage=_texts(rows, "stage"),
        status=_texts(rows, "status"),
        verdict=_texts(rows, "verdict"),
        reason=_texts(rows, "error"),
        time=times,
        error=_numbers(rows, "free_run_error_percent"),
        floor=_numbers(rows, "floor_percent"),
        severe=np.nan_to_num(_numbers(rows, "severe_findings")).astype(int),
        parameters={name: _series(parts) for name, parts in found.items()},
    )


def _series(parts: list[tuple[int, dict[str, object]]]) -> ParameterSeries:
    rows = [parameter for _, parameter in parts]
    return ParameterSeries(
        str(rows[0]["unit"] or ""),
        np.array([i for i, _ in parts], dtype=np.intp),
        _numbers(rows, "value"),
        _numbers(rows, "lower"),
        _numbers(rows, "upper"),
    )


def _texts(rows: list[dict[str, object]], column: str) -> np.ndarray:
    return np.array([str(row[column] or "") for row in rows], dtype=object).astype(str)


def _numbers(rows: list[dict[str, object]], column: str) -> np.ndarray:
    return np.array([np.nan if row[column] is None else row[column] for row in rows], dtype=float)
