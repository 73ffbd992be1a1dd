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

"""`training_data_of`: the blocks into which few records are cut, so that each block can be left out of a fit."""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np

from ...blocks.block import Array
from ...effects.extent import Extent
from ...identification.records.conditioning import with_conditioning
from ...identification.records.leading_step import step_length
from ...model.model import Model
from ...record import Record
from .training_data import TrainingData

BLOCKS = 16
"""Approximate number of blocks into which the records are cut."""
FEWEST = 256
"""Smallest number of samples in a block."""


def training_data_of(
    records: Sequence[Record], fitted: Collection[int], noise: Array, least: Array, model: Model
) -> TrainingData:
    """The blocks of the records `fitted`, a leading jump apart, with a zero in each of several records.

    `noise` and `least` are noise and floor of every record [m], shape (r,). Records that only set the state stay whole
    and have an infinite floor; others are left out. The ranges are in the units of `model`.
    """
    length = max(FEWEST, sum(records[i].size for i in fitted) // BLOCKS)
    blocks, origin, jumps = list[Record](), list[int | None](), list[int]()
    for index in with_conditioning(records, fitted):
        record = records[index]
        if index not in fitted:
            blocks.append(record)
            origin.append(None)
            continue
        step = 0 if record.continues else step_length(record)
        if step:
            jumps.append(len(blocks))
        count = max(1, round((record.size - step) / length))
        edges = {step, *(step + round(k * (record.size - step) / count) for k in range(1, count))}
        cuts = record.split(*sorted(edges - {0}))
        blocks += cuts
        origin += [index] * len(cuts)
    weights, quiet = (np.array([np.inf if k is None else sizes[k] for k in origin]) for sizes in (least, noise))
    extent = Extent.of([records[i] for i in fitted], model.voltage_scale, model.displacement_scale)
    several = sum(not r.continues for r in records) > 1
    return TrainingData(tuple(blocks), weights, extent, tuple(jumps), noise=quiet, offset=several)
