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

"""Columns of numbers <-> sensor_msgs/PointCloud2; fields are found by name and offset, never by position."""

from __future__ import annotations

import array
from collections.abc import Mapping

import numpy as np
from builtin_interfaces.msg import Time
from numpy.typing import ArrayLike, NDArray
from sensor_msgs.msg import PointCloud2, PointField
from std_msgs.msg import Header

from ...point_cloud import packed, point_layout, stored_as, unpacked


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
        Frame of what was measured.
    dense : bool
        False where samples before the first one were never measured.
    """
    points = packed(columns, layout)
    data = array.array("B")
    data.frombytes(points.view(np.uint8).data)
    fields = [PointField(name=f.name, offset=f.offset, datatype=f.datatype, count=1) for f in point_layout(layout)]
    return PointCloud2(
        header=Header(stamp=stamp, frame_id=frame_id),
        height=1,
        width=points.size,
        fields=fields,
        is_bigendian=False,
        point_step=points.itemsize,
        row_step=points.nbytes,
        data=data,
        is_dense=dense,
    )


def from_cloud(
    cloud: PointCloud2, required: Mapping[str, str], optional: Mapping[str, str] | None = None
) -> dict[str, NDArray]:
    """Unpack named fields of any cloud, also of other software, as contiguous arrays.

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
        If a field is missing, a type is wrong, the sizes disagree, there is no point, or a value is not finite.
    """
    return unpacked(cloud.data, *stored_as(cloud, required, optional))
