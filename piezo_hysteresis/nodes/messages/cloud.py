"""Columns of numbers <-> sensor_msgs/PointCloud2; fields are found by name and offset, never by position."""

from __future__ import annotations

import array
from collections.abc import Mapping
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from builtin_interfaces.msg import Time
from numpy.typing import ArrayLike, NDArray
from sensor_msgs.msg import PointCloud2, PointField
from std_msgs.msg import Header

from ...errors import RecordError
from ...record import are_finite

_DATATYPES = {
    PointField.INT8: "i1",
    PointField.UINT8: "u1",
    PointField.INT16: "i2",
    PointField.UINT16: "u2",
    PointField.INT32: "i4",
    PointField.UINT32: "u4",
    PointField.FLOAT32: "f4",
    PointField.FLOAT64: "f8",
}
_CODES = {word: code for code, word in _DATATYPES.items()}

Wanted = tuple[tuple[str, str], ...]
"""Field names with their numpy types."""


def to_cloud(
    columns: Mapping[str, ArrayLike], layout: Mapping[str, str], stamp: Time, frame_id: str = "", *, dense: bool = True
) -> PointCloud2:
    """Pack columns of equal length as a cloud of one row, little-endian and without padding.

    Parameters
    ----------
    columns : mapping of str to (n,) array_like
        Values by field name.
    layout : mapping of str to str
        Field names in the order of the point, with their numpy types; float64 first keeps numpy's views aligned.
    stamp : builtin_interfaces.msg.Time
        Time of the first sample.
    frame_id : str
        Phase or stage name.
    dense : bool
        False where samples before the first one were never measured.
    """
    points = np.empty(np.shape(next(iter(columns.values()))), point_type(layout))
    fields, offset = [], 0
    for name, word in layout.items():
        points[name] = columns[name]
        fields.append(PointField(name=name, offset=offset, datatype=_CODES[word], count=1))
        offset += int(word[1])
    data = array.array("B")
    data.frombytes(points.view(np.uint8).data)
    return PointCloud2(
        header=Header(stamp=stamp, frame_id=frame_id),
        height=1,
        width=points.size,
        fields=fields,
        is_bigendian=False,
        point_step=offset,
        row_step=offset * points.size,
        data=data,
        is_dense=dense,
    )


def point_type(layout: Mapping[str, str]) -> np.dtype:
    """Type of the points that `to_cloud` packs."""
    return np.dtype([(name, "<" + word) for name, word in layout.items()])


def from_cloud(
    cloud: PointCloud2, required: Mapping[str, str], optional: Mapping[str, str] | None = None
) -> dict[str, NDArray]:
    """Unpack named fields of any cloud, ours or foreign, as contiguous arrays.

    Parameters
    ----------
    cloud : sensor_msgs.msg.PointCloud2
        One point per sample.
    required, optional : mapping of str to str
        Field name to the numpy type wanted; a float may come from any number type, an integer from integers only.

    Returns
    -------
    dict of str to (n,) ndarray
        The required fields and those of the optional ones that the cloud has.

    Raises
    ------
    RecordError
        On a missing field, a wrong type, sizes that contradict one another, no point, or a value that is not finite.
    """
    return unpacked(cloud.data, *stored_as(cloud, required, optional))


def stored_as(
    cloud: PointCloud2, required: Mapping[str, str], optional: Mapping[str, str] | None = None
) -> tuple[np.dtype, Wanted]:
    """Type of the points in the data of a cloud, and numpy types of the wanted fields; see `from_cloud`."""
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


def unpacked(data: bytes | array.array[int] | memoryview, dtype: np.dtype, wanted: Wanted) -> dict[str, NDArray]:
    """The wanted fields of the data of a cloud as contiguous arrays; RecordError on a value that is not finite."""
    points = np.frombuffer(data, dtype=dtype)
    arrays: dict[str, NDArray] = {}
    for name, word in wanted:
        arrays[name] = values = points[name].astype(word)
        if word[0] == "f" and not are_finite(values):
            first = int(np.argmin(np.isfinite(values)))
            raise RecordError(f"cloud: {name} {first} is {values[first]}, expected finite values")
    return arrays


class _Field(NamedTuple):
    """A PointField that can be compared."""

    name: str
    offset: int
    datatype: int
    each: int

    def stored_type(self, wanted: str, step: int) -> str:
        """Numpy's word for it; RecordError where it is not what is wanted, or not inside the point."""
        word = _DATATYPES.get(self.datatype)
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
