"""Columns of numbers <-> sensor_msgs/PointCloud2; fields are found by name and offset, never by position."""

from __future__ import annotations

import array
from collections.abc import Mapping

import numpy as np
from builtin_interfaces.msg import Time
from numpy.typing import ArrayLike, NDArray
from sensor_msgs.msg import PointCloud2, PointField
from std_msgs.msg import Header

from ..errors import RecordError

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
    dtype = np.dtype([(name, "<" + word) for name, word in layout.items()])
    points = np.empty(np.shape(next(iter(columns.values()))), dtype)
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
    wanted = {**(optional or {}), **required}
    order = ">" if cloud.is_bigendian else "<"
    found = {field.name: field for field in cloud.fields if field.name in wanted}
    for name in required:
        if name not in found:
            has = ", ".join(field.name for field in cloud.fields) or "none"
            raise RecordError(f"cloud: field '{name}' is missing, got {has}; expected {', '.join(required)}")
    stored = {name: order + _stored_type(field, wanted[name], step) for name, field in found.items()}
    dtype = np.dtype(
        {
            "names": list(stored),
            "formats": list(stored.values()),
            "offsets": [found[name].offset for name in stored],
            "itemsize": step,
        }
    )
    points = np.frombuffer(cloud.data, dtype=dtype)
    arrays = {name: np.ascontiguousarray(points[name], dtype=wanted[name]) for name in stored}
    for name, values in arrays.items():
        if not np.isfinite(values).all():
            first = int(np.argmin(np.isfinite(values)))
            raise RecordError(f"cloud: {name} {first} is {values[first]}, expected finite values")
    return arrays


def _stored_type(field: PointField, wanted: str, step: int) -> str:
    word = _DATATYPES.get(field.datatype)
    if word is None or field.count > 1:
        raise RecordError(
            f"cloud: field '{field.name}' has datatype {field.datatype} x {field.count}, expected one number per point"
        )
    if wanted[0] != "f" and (word[0] == "f" or int(word[1]) > int(wanted[1])):
        raise RecordError(f"cloud: field '{field.name}' has type {word}, expected {wanted}")
    if field.offset + int(word[1]) > step:
        raise RecordError(
            f"cloud: field '{field.name}' at offset {field.offset} leaves the point of {step} bytes; expected it inside"
        )
    return word
