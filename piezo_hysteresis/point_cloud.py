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

"""Columns of numbers <-> the bytes of a sensor_msgs/PointCloud2, without ROS: for nodes and for readers of bags.

Fields are found by name and offset, never by position.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from functools import lru_cache
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .channel_mapping import are_finite
from .errors import RecordError

DATATYPES: Mapping[int, str] = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 8: "f8"}
"""Numbers of sensor_msgs/PointField to numpy's words."""

_CODES = {word: code for code, word in DATATYPES.items()}
"""Numpy's words to the numbers of sensor_msgs/PointField."""

Wanted = tuple[tuple[str, str], ...]
"""Field names with their numpy types."""


class CloudLike(Protocol):
    """What of a sensor_msgs/PointCloud2 is looked at."""

    width: int
    height: int
    point_step: int
    row_step: int
    is_bigendian: bool
    fields: Sequence[Any]
    data: Any


class PointLayout(NamedTuple):
    """One field of a point: name, place in the point [bytes], datatype of sensor_msgs/PointField."""

    name: str
    offset: int
    datatype: int


def with_further(layout: Mapping[str, str], columns: Iterable[str]) -> dict[str, str]:
    """The layout, and behind it every column that it does not name, as float64.

    >>> with_further({"voltage": "f8", "phase": "u4"}, ["voltage", "temperature"])
    {'voltage': 'f8', 'phase': 'u4', 'temperature': 'f8'}
    """
    return {**layout, **{name: "f8" for name in columns if name not in layout}}


def point_type(layout: Mapping[str, str]) -> np.dtype:
    """Type of the points that `packed` packs."""
    return np.dtype([(name, "<" + word) for name, word in layout.items()])


def point_layout(layout: Mapping[str, str]) -> tuple[PointLayout, ...]:
    """Fields of the points that `packed` packs, in their order.

    >>> point_layout({"voltage": "f8", "phase": "u4"})[1]
    PointLayout(name='phase', offset=8, datatype=6)
    """
    fields, offset = [], 0
    for name, word in layout.items():
        fields.append(PointLayout(name, offset, _CODES[word]))
        offset += int(word[1])
    return tuple(fields)


def packed(columns: Mapping[str, ArrayLike], layout: Mapping[str, str]) -> NDArray:
    """Points of columns of equal length, little-endian and without padding.

    Parameters
    ----------
    columns : mapping of str to (n,) array_like
        Values by field name; the length of the first one is their number.
    layout : mapping of str to str
        Field names in the order of the point, with their numpy types; float64 first keeps numpy's views aligned.

    Returns
    -------
    (n,) ndarray of `point_type`
    """
    points = np.empty(np.shape(next(iter(columns.values()))), point_type(layout))
    for name in layout:
        points[name] = columns[name]
    return points


def stored_as(
    cloud: CloudLike, required: Mapping[str, str], optional: Mapping[str, str] | None = None
) -> tuple[np.dtype, Wanted]:
    """Type of the points in the data of a cloud, and numpy types of the wanted fields.

    Parameters
    ----------
    cloud : sensor_msgs.msg.PointCloud2 or its like
        A message as ROS or as a reader of bags holds it.
    required, optional : mapping of str to str
        Field name to the numpy type wanted; a float may come from any number type, an integer from integers only.

    Returns
    -------
    dtype : dtype
        Of one point in the data.
    wanted : tuple of (str, str)
        The required fields and those of the optional ones that the cloud has, with the types wanted.

    Raises
    ------
    RecordError
        On a missing field, a wrong type, sizes that contradict one another, or no point.
    """
    count = cloud.width * cloud.height
    step = cloud.point_step
    if count == 0:
        raise RecordError("cloud: got no points, expected at least one sample")
    if cloud.height > 1 and cloud.row_step != cloud.width * step:
        raise RecordError(
            f"cloud: got padded rows ({cloud.row_step} bytes), expected {cloud.width * step}; send one row"
        )
    if len(cloud.data) != count * step:
        raise RecordError(
            f"cloud: got {len(cloud.data)} bytes, expected {count} points of {step} bytes; it is truncated"
        )
    fields = tuple(_Field(field.name, field.offset, field.datatype, field.count) for field in cloud.fields)
    given = tuple(required.items()), tuple(optional.items()) if optional else ()
    return _stored(fields, step, cloud.is_bigendian, *given)


def unpacked(data: Any, dtype: np.dtype, wanted: Wanted, *, finite: bool = True) -> dict[str, NDArray]:
    """The wanted fields of the data of a cloud as contiguous arrays.

    Parameters
    ----------
    data : buffer
        Bytes of the points.
    dtype, wanted
        As `stored_as` gives them.
    finite : bool
        False to keep values that are not finite, as a recording may hold them.

    Raises
    ------
    RecordError
        On a value that is not finite, if `finite`.
    """
    points = np.frombuffer(data, dtype=dtype)
    arrays: dict[str, NDArray] = {}
    for name, word in wanted:
        arrays[name] = values = points[name].astype(word)
        if finite and word[0] == "f" and not are_finite(values):
            first = int(np.argmin(np.isfinite(values)))
            raise RecordError(f"cloud: {name} {first} is {values[first]}, expected finite values")
    return arrays


class _Field(NamedTuple):
    """A field of a point that can be compared."""

    name: str
    offset: int
    datatype: int
    each: int

    def stored_type(self, wanted: str, step: int) -> str:
        """Numpy's word for it; RecordError where it is not what is wanted, or not inside the point."""
        word = DATATYPES.get(self.datatype)
        if word is None or self.each > 1:
            raise RecordError(
                f"cloud: field '{self.name}' has datatype {self.datatype} x {self.each}, expected one number per point"
            )
        if wanted[0] != "f" and (word[0] == "f" or int(word[1]) > int(wanted[1])):
            raise RecordError(f"cloud: field '{self.name}' has type {word}, expected {wanted}")
        if self.offset + int(word[1]) > step:
            raise RecordError(
                f"cloud: field '{self.name}' at offset {self.offset} leaves the point of {step} bytes; "
                "expected it inside"
            )
        return word


@lru_cache(maxsize=8)
def _stored(
    fields: tuple[_Field, ...], step: int, big_endian: bool, required: Wanted, optional: Wanted
) -> tuple[np.dtype, Wanted]:
    """The wanted fields of a point: looked for once, for a stream brings the same ones with every message."""
    wanted = dict(optional + required)
    order = ">" if big_endian else "<"
    found = {field.name: field for field in fields if field.name in wanted}
    for name, _ in required:
        if name not in found:
            has = ", ".join(field.name for field in fields) or "none"
            expected = ", ".join(name for name, _ in required)
            raise RecordError(f"cloud: field '{name}' is missing, got {has}; expected {expected}")
    dtype = np.dtype(
        {
            "names": list(found),
            "formats": [order + field.stored_type(wanted[name], step) for name, field in found.items()],
            "offsets": [field.offset for field in found.values()],
            "itemsize": step,
        }
    )
    return dtype, tuple((name, wanted[name]) for name in found)
