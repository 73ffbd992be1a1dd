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

"""Messages of `samples` and `predicted_samples`: conversion from and to `SampleBlock`."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray
from sensor_msgs.msg import PointCloud2

from ...acquisition.sample_block import SampleBlock
from ...channel_mapping import quantity_of
from ...errors import RecordError, printable
from ...point_cloud import with_further
from .cloud import to_cloud
from .cloud_stream import CloudReader, CloudWriter, Columns, read_cloud
from .conversions import PERIOD_TOLERANCE, Samples, from_stamp, to_stamp

SAMPLES = {"time": "f8", "voltage": "f8", "displacement": "f8", "index": "u4", "phase": "u4"}
"""Point of `samples`: time@0, voltage@8, displacement@16, index@24, phase@28. Further channels of the stage follow."""

PREDICTED_SAMPLES = {
    "time": "f8",
    "displacement": "f8",
    "prediction": "f8",
    "residual": "f8",
    "index": "u4",
    "model": "u4",
}
"""Point of `predicted_samples`: time@0, displacement@8, prediction@16, residual@24, index@32, model@36. The three
columns of further displacements follow."""

_END_OF_TIME = 2**31
"""Messages count seconds in 32 bits."""

_LONGEST_FRAME = 200
"""Characters of the name of a frame that are passed on."""

_LARGEST = {"voltage": 1e4, "displacement": 1.0}
"""Limits that no piezo stage exceeds: drive voltage [V] and displacement [m]."""


def samples_to_cloud(block: SampleBlock) -> PointCloud2:
    """Message of `samples`."""
    layout = with_further(SAMPLES, block.channels)
    return to_cloud(block.columns, layout, to_stamp(block.stamp), block.frame, dense=not block.follows_gap)


class SampleWriter:
    """Serialised messages of `samples`: the bytes of `samples_to_cloud`, for a stream of blocks."""

    def __init__(self) -> None:
        self._writer = CloudWriter(SAMPLES)

    def write(self, block: SampleBlock) -> bytes:
        """Message of one block."""
        return self._writer.write(block.columns, to_stamp(block.stamp), block.frame, dense=not block.follows_gap)


def samples_from_cloud(cloud: PointCloud2) -> SampleBlock:
    """Block of a message of `samples`, also of other software.

    Raises
    ------
    RecordError
        If fields are missing or wrong, sizes are wrong, values are not finite or beyond all stages, or samples are not
        evenly spaced.
    """
    return _block(read_cloud(cloud, SAMPLES))


class SampleReader:
    """Reads blocks from serialised messages of `samples`, also of other software.

    Parameters
    ----------
    further : callable
        Whether a channel of a given name is read besides voltage and displacement; by default none is.
    """

    def __init__(self, further: Callable[[str], object] = lambda name: False) -> None:
        self._reader = CloudReader(SAMPLES, further)

    def read(self, message: bytes) -> SampleBlock:
        """Block of one message; raises RecordError as `samples_from_cloud` does."""
        return _block(self._reader.read(message))


def _block(columns: Columns) -> SampleBlock:
    block = SampleBlock(
        from_stamp(columns.stamp),
        **{name: columns.values[name] for name in SAMPLES},
        frame=printable(columns.frame_id[:_LONGEST_FRAME]),
        follows_gap=not columns.dense,
        channels={name: values for name, values in columns.values.items() if name not in SAMPLES},
    )
    _require_consecutive(block)
    limits = _LARGEST | {name: _LARGEST.get(quantity_of(name) or "", np.inf) for name in block.channels}
    for name, largest in limits.items():
        values = columns.values[name]
        if np.abs(values).max() > largest:
            worst = float(values[np.abs(values).argmax()])
            raise RecordError(f"samples: got a {name} of {worst:g}, expected at most {largest:g}")
    return block


def _require_consecutive(block: SampleBlock) -> None:
    count, places = _counting(block.size)
    jumps = block.index - block.index[0] != count
    if jumps.any():
        raise RecordError(f"samples: the index jumps at sample {int(jumps.argmax())}, expected consecutive samples")
    first, last = float(block.time[0]), float(block.time[-1])
    if not all(0 <= block.stamp * 1e-9 + time < _END_OF_TIME for time in (first, last)):
        raise RecordError(f"samples: got {first:g} to {last:g} s after the stamp {block.stamp} ns, expected a date")
    period = block.sample_period
    if period is None:
        return
    off = float(np.abs(block.time - first - period * places).max())
    if not off <= PERIOD_TOLERANCE * period:
        raise RecordError(f"samples: times are {off:.3g} s off a period of {period:.6g} s, expected even ones")


@lru_cache(maxsize=2)
def _counting(size: int) -> tuple[NDArray[np.uint32], Samples]:
    """0, 1, 2, … as index and as float; cached, because the blocks of a stream have one size."""
    index, number = np.arange(size, dtype=np.uint32), np.arange(size, dtype=np.float64)
    for values in (index, number):
        values.setflags(write=False)
    return index, number


class PredictionWriter:
    """Serialised messages of `predicted_samples`."""

    def __init__(self) -> None:
        self._writer = CloudWriter(PREDICTED_SAMPLES)

    def write(self, block: SampleBlock, results: Mapping[str, Samples], model: int, *, valid: bool = True) -> bytes:
        """Message for the samples of a block.

        Parameters
        ----------
        block : SampleBlock
            Measured samples.
        results : mapping of str to (n,) ndarray
            ``prediction`` and ``residual`` (measured minus predicted) [m]; for a stage of several axes also
            ``displacement_2``, ``prediction_2``, ``residual_2``, …
        model : int
            First 32 bits of the model's hash.
        valid : bool
            False while warming up or bridging a gap.
        """
        columns: dict[str, ArrayLike] = {
            "time": block.time,
            "displacement": block.displacement,
            "index": block.index,
            "model": model,
            **results,
        }
        return self._writer.write(columns, to_stamp(block.stamp), block.frame, dense=valid)
