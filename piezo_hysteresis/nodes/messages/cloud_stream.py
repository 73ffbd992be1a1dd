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

"""Packs and unpacks streams of sensor_msgs/PointCloud2. The parts that all messages share are processed once."""

from __future__ import annotations

import array
import struct
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from builtin_interfaces.msg import Time
from numpy.typing import ArrayLike, NDArray
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import PointCloud2

from ...errors import RecordError
from ...point_cloud import point_type, stored_as, unpacked, with_further
from .cloud import from_cloud, to_cloud

_STAMP = struct.Struct("=iI")
"""Stamp of a header: seconds and nanoseconds."""
_STAMP_AT = 4
"""Position of the stamp in a serialised cloud, after four bytes about the encoding."""
_AFTER_STAMP = _STAMP_AT + _STAMP.size
"""Bytes of a message before the name of its frame."""
_LONGEST_END = 4
"""Largest number of bytes after the data: `is_dense`, and up to three bytes of padding."""


@dataclass(frozen=True, eq=False, slots=True)
class Columns:
    """Content of a cloud.

    Parameters
    ----------
    stamp : builtin_interfaces.msg.Time
        Time of the first sample.
    frame_id : str
        Phase or stage name.
    dense : bool
        False where samples before the first one were never measured.
    values : dict of str to (n,) ndarray
        By field name.
    """

    stamp: Time
    frame_id: str
    dense: bool
    values: dict[str, NDArray]


def read_cloud(cloud: PointCloud2, required: Mapping[str, str], optional: Mapping[str, str] | None = None) -> Columns:
    """Columns of a cloud; fields, types and errors as for `from_cloud`."""
    return Columns(cloud.header.stamp, cloud.header.frame_id, cloud.is_dense, from_cloud(cloud, required, optional))


class CloudWriter:
    """Packs columns into the bytes that a publisher would send for the message of `to_cloud`.

    Parameters
    ----------
    layout : mapping of str to str
        Field names in the order of the point, with their numpy types. Further columns follow as float64.
    """

    def __init__(self, layout: Mapping[str, str]) -> None:
        self._layout = layout
        self._common: tuple[int, str, tuple[str, ...]] | None = None

    def write(self, columns: Mapping[str, ArrayLike], stamp: Time, frame_id: str = "", *, dense: bool = True) -> bytes:
        """Serialised cloud; parameters as for `to_cloud`; the first column gives the number of points."""
        common = np.size(next(iter(columns.values()))), frame_id, tuple(columns)
        if common != self._common:
            self._begin(*common)
            self._common = common
        for name, field in self._fields.items():
            field[:] = columns[name]
        message = self._frame.message
        _STAMP.pack_into(message, _STAMP_AT, stamp.sec, stamp.nanosec)
        message[self._frame.stop] = dense
        return bytes(message)

    def _begin(self, size: int, frame_id: str, names: tuple[str, ...]) -> None:
        layout = with_further(self._layout, names)
        blank = {name: np.zeros(size, word) for name, word in layout.items()}
        self._frame = _Frame(to_cloud(blank, layout, Time(), frame_id))
        points = np.frombuffer(self._frame.message, point_type(layout), size, self._frame.start)
        self._fields = {name: points[name] for name in layout}


class CloudReader:
    """Unpacks serialised clouds, also of other software, as `read_cloud` does.

    A message that differs from the one before only in stamp, data and `is_dense` is not deserialised.

    Parameters
    ----------
    required : mapping of str to str
        Field names and the numpy types wanted.
    further : callable
        Whether a field of another name is read too, as float64; by default none is.
    """

    def __init__(self, required: Mapping[str, str], further: Callable[[str], object] = lambda name: False) -> None:
        self._required, self._further = required, further
        self._known: _Known | None = None

    def read(self, message: bytes) -> Columns:
        """Columns of a serialised cloud.

        Raises
        ------
        RecordError
            As `read_cloud`, and if the bytes are not a cloud.
        """
        if self._known is not None and self._known.is_like(message):
            return self._known.read(message)
        try:
            cloud = deserialize_message(message, PointCloud2)
        except RuntimeError as error:  # a middleware may raise any error
            raise RecordError(f"cloud: got {len(message)} bytes of something else, expected a cloud") from error
        names = (field.name for field in cloud.fields)
        others = {name: "f8" for name in names if name not in self._required and self._further(name)}
        columns = read_cloud(cloud, self._required, others)
        self._known = _Known(cloud, message, self._required, others)
        return columns


class _Known:
    """Layout of the messages that are like one deserialised message; that message is modified."""

    def __init__(
        self, cloud: PointCloud2, message: bytes, required: Mapping[str, str], optional: Mapping[str, str]
    ) -> None:
        self._dtype, self._wanted = stored_as(cloud, required, optional)
        self._frame_id = cloud.header.frame_id
        frame = _Frame(cloud)
        self._start, self._stop = frame.start, frame.stop
        self._encoding = bytes(frame.message[:_STAMP_AT])
        self._between = message[_AFTER_STAMP : self._start]

    def is_like(self, message: bytes) -> bool:
        """True where the message can differ only in stamp, data and `is_dense`, at the same positions."""
        return (
            message[_AFTER_STAMP : self._start] == self._between
            and message[:_STAMP_AT] == self._encoding
            and 0 < len(message) - self._stop <= _LONGEST_END
        )

    def read(self, message: bytes) -> Columns:
        """Columns of one such message."""
        seconds, rest = _STAMP.unpack_from(message, _STAMP_AT)
        values = unpacked(memoryview(message)[self._start : self._stop], self._dtype, self._wanted)
        return Columns(Time(sec=seconds, nanosec=rest), self._frame_id, bool(message[self._stop]), values)


class _Frame:
    """A serialised cloud without its data, and the position of the data; `is_dense` follows them.

    Parameters
    ----------
    cloud : sensor_msgs.msg.PointCloud2
        The cloud, whose data are removed.
    """

    def __init__(self, cloud: PointCloud2) -> None:
        mark = b"\xff" * len(cloud.data)
        cloud.data, cloud.is_dense = array.array("B", mark), True
        self.message = bytearray(serialize_message(cloud))
        self.start = self.message.rindex(mark + b"\x01")
        self.stop = self.start + len(mark)
