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

"""`ResidualAlarm`: decides when the residual is a warning or an error on /diagnostics, with the parameters for this."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from diagnostic_msgs.msg import DiagnosticStatus

from ...parameter import Parameter, Row

_SOURCE = "model node"
"""Source of the parameters of the alarm."""

ALARM: tuple[Row, ...] = (
    Parameter(
        "residual_warn",
        "k_w",
        "1",
        3.0,
        0.0,
        1e6,
        "residual that causes a warning, in free-run errors of the model",
        _SOURCE,
    ),
    Parameter(
        "residual_error",
        "k_e",
        "1",
        10.0,
        0.0,
        1e6,
        "residual that causes an error, in free-run errors of the model",
        _SOURCE,
    ),
)
"""Alarm thresholds: parameters of the model node."""


class ResidualAlarm:
    """Compares the RMS residual with the free-run error that the model file states.

    Parameters
    ----------
    values : mapping
        Values of `ALARM`, by name.
    """

    def __init__(self, values: Mapping[str, Any]) -> None:
        self._warn, self._error = float(values["residual_warn"]), float(values["residual_error"])

    def finding(self, rms: float | None, free_run_error: float | None) -> tuple[bytes, str] | None:
        """Level and message of an alarm; None where there is none, or one of the two values [m] is unknown or 0."""
        if rms is None or not free_run_error or rms <= self._warn * free_run_error:
            return None
        level = DiagnosticStatus.ERROR if rms > self._error * free_run_error else DiagnosticStatus.WARN
        return level, f"the residual is {rms / free_run_error:.3g} times the free-run error of the model"
