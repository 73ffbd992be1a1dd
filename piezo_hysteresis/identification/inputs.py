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

"""The inputs of `identify` and `diagnose`, as they are given in Python."""

from __future__ import annotations

import math
from collections.abc import Iterable

from ..effects import HysteresisOperator
from ..errors import ParameterError, RecordError
from ..record import Experiment, Record


def experiment_of(given: Record | Iterable[Record]) -> Experiment:
    """The experiment that is given: itself, a record, or several records.

    Raises
    ------
    RecordError
        If it is something else.
    """
    if isinstance(given, Experiment):
        return given
    records = tuple(given) if isinstance(given, Iterable) and not isinstance(given, Record) else (given,)
    for record in records:
        if not isinstance(record, Record):
            raise RecordError(
                f"experiment: got {type(record).__name__}, expected an Experiment, a Record or several; "
                "`piezo_hysteresis.read` reads a recording"
            )
    return Experiment(records)


def check_gauge(
    voltage_scale: float | None,
    displacement_scale: float | None,
    gain: float | None,
    hysteresis: type[HysteresisOperator],
) -> None:
    """Check what an identified model is expressed in.

    Raises
    ------
    ParameterError
        If a scale is not positive, the gain is 0, or the hysteresis is not a class.
    """
    for name, scale in (("voltage_scale", voltage_scale), ("displacement_scale", displacement_scale)):
        if scale is not None and not 0.0 < scale < math.inf:
            raise ParameterError(f"{name}: got {scale!r}, expected a positive number or None")
    if gain is not None and (gain == 0.0 or not math.isfinite(gain)):
        raise ParameterError(f"gain: got {gain!r}, expected a number other than 0, or None")
    if not (isinstance(hysteresis, type) and issubclass(hysteresis, HysteresisOperator)):
        raise ParameterError(f"hysteresis: got {hysteresis!r}, expected a class of operators, such as BoucWen")
