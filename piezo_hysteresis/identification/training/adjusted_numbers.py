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

"""Which parameters of a model a joint fit adjusts, and in which directions."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...blocks.block import Array
from ...effects import Arx, MainsHum, Offset
from ...model.model import Model
from ..fit.bounded_step import gauge
from .training_data import TrainingData


def adjusted_numbers(model: Model, training_data: TrainingData) -> list[str]:
    """Parameters that a joint fit adjusts: all except fixed ones, a whole delay, and those that are free per record.

    A delay of whole samples was found in the response to a step. A fraction of a sample was fitted, and goes on to be.
    `settling` of the offset is not adjusted if all records start at one level, because the data do not determine it.
    """
    values, skipped = model.values(), {f"{MainsHum.name}.f"}
    if float(values.get(f"{Arx.name}.delay", 0.0)).is_integer():
        skipped.add(f"{Arx.name}.delay")
    if training_data.offset:
        skipped.add(f"{Offset.name}.y0")
    if training_data.offset or not training_data.begins_at_levels:
        skipped.add(f"{Offset.name}.settling")
    if loop_is_off(model):  # it stays off
        skipped |= {f"{model.hysteresis.name}.{n}" for n in model.hysteresis.memory_names}
    rows = {n: model.row(n) for n in values if n not in skipped}
    return [n for n, row in rows.items() if not (row.fixed or row.per_record)]


def loop_is_off(model: Model) -> bool:
    """Whether the loop of the model is switched off."""
    return model.has_hysteresis and not model.hysteresis.has_memory


def directions(model: Model, names: Sequence[str], extra: int = 0) -> Array:
    """Columns for `cross_validate`: free parameters at constant G(1), then `extra` rows; none for the residual."""
    free = gauge(model, names)
    columns = np.zeros((len(names) + extra + 1, free.shape[1] + extra))
    columns[: len(names), : free.shape[1]] = free
    columns[len(names) : len(names) + extra, free.shape[1] :] = np.eye(extra)
    return columns
