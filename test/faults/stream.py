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

"""`Stream`: what a driver would send, block by block from a model that is the truth, so that it can be spoilt."""

from __future__ import annotations

import array
from dataclasses import replace

import numpy as np
from sensor_msgs.msg import PointCloud2

from piezo_hysteresis.acquisition.sample_block import SampleBlock
from piezo_hysteresis.effects import Arx, BoucWen
from piezo_hysteresis.model.model import Model
from piezo_hysteresis.nodes.messages.cloud import from_cloud
from piezo_hysteresis.nodes.messages.samples import PREDICTED_SAMPLES, SAMPLES, samples_to_cloud

PERIOD, SIZE = 1e-4, 100
MODEL = Model((BoucWen(), Arx(a=[-0.8], b=[0.05])), PERIOD, displacement_scale=1e-4)
OFFSET = 5e-6
STROKE = float(np.ptp(MODEL.run(6 * np.sin(np.linspace(0, 3, 10_000)) ** 2, MODEL.rest(0.0))[0]))
FALSE = 2e-3 * STROKE
"""A residual beyond it is a false prediction: the truth is noiseless, and loops have forgotten to a thousandth."""


class Stream:
    """Consecutive blocks of a stage that began at rest, then moves in loops of 20 Hz from 0 to 6 V.

    Parameters
    ----------
    first : int
        Index of the first sample, modulo 2³².
    """

    def __init__(self, first: int = 0) -> None:
        self.first, self.count, self.stamp = first, 0, 1_700_000_000_000_000_000
        self._state = MODEL.rest(0.0)

    def block(self, resting: bool = False) -> SampleBlock:
        """The next block; a resting one prolongs the rest at the beginning."""
        at = 0 if resting else self.count + np.arange(SIZE)
        voltage = np.broadcast_to(3 - 3 * np.cos(2 * np.pi * 20 * PERIOD * at), SIZE).copy()
        displacement, self._state = MODEL.run(voltage, self._state)
        index = (self.first + np.arange(SIZE)) % 2**32
        block = SampleBlock(
            self.stamp,
            PERIOD * np.arange(SIZE),
            voltage,
            displacement + OFFSET,
            index.astype(np.uint32),
            np.full(SIZE, 0 if resting else 1, np.uint32),
            "bench",
        )
        self.first += SIZE
        self.stamp += round(SIZE * PERIOD * 1e9)
        if not resting:
            self.count += SIZE
        return block

    def blocks(self, number: int, resting: bool = False) -> list[SampleBlock]:
        """So many blocks."""
        return [self.block(resting) for _ in range(number)]


def spoilt(block: SampleBlock, **columns: np.ndarray) -> PointCloud2:
    """A message of a block with other columns."""
    return samples_to_cloud(replace(block, **columns))


def with_bytes(cloud: PointCloud2, data: bytes) -> PointCloud2:
    """A cloud with other bytes."""
    cloud.data = array.array("B", data)
    return cloud


def foreign(block: SampleBlock) -> PointCloud2:
    """The same samples as other software might write them: big endian, another order, gaps and fields of its own."""
    cloud = samples_to_cloud(block)
    offsets = {"index": 4, "displacement": 16, "phase": 0, "voltage": 32, "time": 24, "temperature": 40}
    types = {**SAMPLES, "temperature": "f8"}
    dtype = np.dtype(
        {
            "names": list(offsets),
            "formats": [">" + types[name] for name in offsets],
            "offsets": list(offsets.values()),
            "itemsize": 56,
        }
    )
    points = np.zeros(block.size, dtype)
    for name in SAMPLES:
        points[name] = getattr(block, name)
    points["temperature"] = np.nan
    for field in cloud.fields:
        field.offset = offsets[field.name]
    cloud.fields.append(type(cloud.fields[0])(name="temperature", offset=40, datatype=8, count=1))
    cloud.point_step, cloud.row_step, cloud.is_bigendian = 56, 56 * block.size, True
    return with_bytes(cloud, points.tobytes())


def predictions(clouds: list[PointCloud2]) -> list[tuple[int, bool, float]]:
    """Index of the first sample, whether it is published as good, and largest residual of every block [m]."""
    predicted = []
    for cloud in list(clouds):
        columns = from_cloud(cloud, PREDICTED_SAMPLES)
        predicted.append((int(columns["index"][0]), bool(cloud.is_dense), float(np.abs(columns["residual"]).max())))
    return predicted
