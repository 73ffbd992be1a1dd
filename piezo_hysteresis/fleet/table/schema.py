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

"""The columns of the results."""

from __future__ import annotations

from functools import cache
from typing import Any

from ..extra import package

PARTITIONS = ("stage", "month")
"""Columns that are stored in the names of the folders."""


@cache
def schema() -> Any:
    """The Arrow schema of a row, without the columns of `PARTITIONS`."""
    pa = package("pyarrow")
    text, number, moment = pa.string(), pa.float64(), pa.timestamp("us", tz="UTC")
    parameter = pa.struct(
        [
            ("name", text),
            ("value", number),
            ("lower", number),
            ("upper", number),
            ("unit", text),
            ("at_bound", pa.bool_()),
        ]
    )
    finding = pa.struct([("kind", text), ("phase", text), ("message", text), ("severe", pa.bool_())])
    return pa.schema(
        [
            pa.field("recording", text, nullable=False),
            pa.field("task", text, nullable=False),
            pa.field("status", text, nullable=False),
            ("recorded_at", moment),
            ("verdict", text),
            ("effects", pa.list_(text)),
            ("converged", pa.bool_()),
            ("free_run_error_m", number),
            ("free_run_error_percent", number),
            ("before_percent", number),
            ("floor_percent", number),
            ("range_m", number),
            ("samples", pa.int64()),
            ("duration_s", number),
            ("parameters", pa.list_(parameter)),
            ("quality", pa.list_(finding)),
            ("severe_findings", pa.int32()),
            ("error", text),
            ("model", text),
            ("data_hash", text),
            ("code_hash", text),
            ("settings_hash", text),
            ("version", text),
            ("time_limit_s", number),
            ("seconds", number),
            ("processor_seconds", number),
            ("worker", text),
            pa.field("finished_at", moment, nullable=False),
        ]
    )
