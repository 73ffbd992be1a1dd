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
from ...identification.fit.normal_equations import Nuisance
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
    """The blocks of the records `fitted`, with their floors and what is free in each record.

    Parameters
    ----------
    records : sequence of Record
        In order.
    fitted : collection of int
        Indices of the records to fit; the others only determine the state of the stage.
    noise, least : (r,) ndarray
        Noise and floor of every record [m].
    model : Model
        Model with which the fit begins.
    """
    blocks, origin = blocks_of(records, fitted)
    weights, quiet = (np.array([np.inf if k is None else sizes[k] for k in origin]) for sizes in (least, noise))
    jumps = tuple(i for i, b in enumerate(blocks) if not b.continues and step_length(records[origin[i] or 0]) == b.size)
    extent = Extent.of([records[i] for i in fitted], model.voltage_scale, model.displacement_scale)
    free = Nuisance(offset=sum(not r.continues for r in records) > 1)
    return TrainingData(tuple(blocks), weights, free, extent, jumps, noise=quiet)


def blocks_of(records: Sequence[Record], used: Collection[int]) -> tuple[list[Record], list[int | None]]:
    """Blocks of the records `used`, a leading jump apart, and the record of each (None: it only sets the state).

    Records that none of them continues are left out.

    Parameters
    ----------
    records : sequence of Record
        Records in order.
    used : collection of int
        Indices of the records to cut.
    """
    length = max(FEWEST, sum(records[i].size for i in used) // BLOCKS)
    blocks: list[Record] = []
    origin: list[int | None] = []
    for index in with_conditioning(records, used):
        record = records[index]
        if index not in used:
            blocks.append(record)
            origin.append(None)
            continue
        step = 0 if record.continues else step_length(record)
        count = max(1, round((record.size - step) / length))
        edges = {step, *(step + round(k * (record.size - step) / count) for k in range(1, count))}
        cuts = record.split(*sorted(edges - {0}))
        blocks += cuts
        origin += [index] * len(cuts)
    return blocks, origin
