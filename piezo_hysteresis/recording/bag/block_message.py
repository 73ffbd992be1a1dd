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

"""`BlockMessage`: one message of the topic `samples`, as arrays."""

from __future__ import annotations

import functools
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rosbags.typesys import Stores, get_typestore
from rosbags.typesys.store import Typestore

from ...channel_mapping import quantity_of
from ...point_cloud import packed, point_layout, stored_as, unpacked, with_further
from ...record import Samples

TYPE = "sensor_msgs/msg/PointCloud2"
"""Type of the messages."""

FIELDS = {"time": "f8", "voltage": "f8", "displacement": "f8", "index": "u4", "phase": "u4"}
"""Point of `samples`: time [s from the stamp], voltage [V], displacement [m], running index, phase number."""

_REQUIRED = {"voltage": "f8", "displacement": "f8"}
"""Fields that every block needs."""

_OPTIONAL = {name: FIELDS[name] for name in ("time", "index", "phase")}
"""Fields that a block need not have."""


@functools.cache
def typestore() -> Typestore:
    """The message types of a ROS 2 installation."""
    return get_typestore(Stores.ROS2_KILTED)


@dataclass(frozen=True, eq=False, slots=True)
class BlockMessage:
    """Consecutive samples of a stage.

    Parameters
    ----------
    stamp_ns : int
        Time from which `time` counts [ns].
    channels : dict of str to (n,) ndarray
        `voltage` [V], `displacement` [m], and where there are such fields what `Record.channels` may hold.
    phase : (n,) ndarray of uint32
        Phase number of every sample; zeros where the message has none.
    time : (n,) ndarray, optional
        Time of every sample from the stamp [s].
    index : (n,) ndarray of uint32, optional
        Running number of every sample, modulo 2³².
    follows_pause : bool
        True where the samples before it were never measured, while the voltage was held: a device that reads out its
        memory.
    """

    stamp_ns: int
    channels: dict[str, Samples]
    phase: NDArray[np.uint32]
    time: Samples | None = None
    index: NDArray[np.uint32] | None = None
    follows_pause: bool = False

    @classmethod
    def from_cdr(cls, raw: bytes) -> BlockMessage:
        """Decode a serialised PointCloud2 by the names and offsets of its fields.

        Parameters
        ----------
        raw : bytes
            CDR with its encapsulation header.

        Raises
        ------
        RecordError
            If the message has no voltage and displacement, or another number of bytes than it declares.
        """
        message: Any = typestore().deserialize_cdr(raw, TYPE)
        others = {field.name: "f8" for field in message.fields if quantity_of(field.name)}
        dtype, wanted = stored_as(message, _REQUIRED, others | _OPTIONAL)
        columns = unpacked(message.data, dtype, wanted, finite=False)
        return cls(
            int(message.header.stamp.sec) * 1_000_000_000 + int(message.header.stamp.nanosec),
            {name: columns[name] for name in (*_REQUIRED, *(others.keys() - _REQUIRED.keys()))},
            columns["phase"] if "phase" in columns else np.zeros(columns["voltage"].size, np.uint32),
            columns.get("time"),
            columns.get("index"),
            not message.is_dense,
        )

    def to_cdr(self, frame_id: str = "") -> bytes:
        """Serialised PointCloud2 of `FIELDS`, as the driver publishes it, and of the other channels behind them."""
        none = np.zeros(self.phase.size, np.uint32)
        numbers: dict[str, Any] = {
            "time": none if self.time is None else self.time,
            "index": none if self.index is None else self.index,
            "phase": self.phase,
        }
        layout = with_further(FIELDS, sorted(self.channels))
        points = packed(self.channels | numbers, layout)
        kinds = typestore().types
        stamp = kinds["builtin_interfaces/msg/Time"](*divmod(self.stamp_ns, 1_000_000_000))
        field = kinds["sensor_msgs/msg/PointField"]
        fields = [field(name, offset, datatype, 1) for name, offset, datatype in point_layout(layout)]
        data = points.view(np.uint8)
        cloud = kinds[TYPE](
            kinds["std_msgs/msg/Header"](stamp, frame_id),
            1, points.size, fields, False, points.itemsize, data.size, data, not self.follows_pause,
        )  # fmt: skip
        return bytes(typestore().serialize_cdr(cloud, TYPE))
