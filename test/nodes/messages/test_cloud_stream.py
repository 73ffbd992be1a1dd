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

"""Clouds of any make are read from their bytes as they are read from messages, whatever came before them."""

import numpy as np
import pytest
from builtin_interfaces.msg import Time
from rclpy.serialization import deserialize_message, serialize_message
from rosbags.typesys import Stores, get_typestore
from sensor_msgs.msg import PointCloud2

from piezo_hysteresis.errors import RecordError
from piezo_hysteresis.nodes.messages.cloud import to_cloud
from piezo_hysteresis.nodes.messages.cloud_stream import CloudReader, CloudWriter, read_cloud

LAYOUT = {"x": "f8", "n": "u4"}
STORE = get_typestore(Stores.ROS2_KILTED)


def cloud(size=3, frame="stage", dense=True, at=7, layout=LAYOUT):
    columns = {name: at + np.arange(size) for name in layout}
    return to_cloud(columns, layout, Time(sec=at, nanosec=999_999_999), frame, dense=dense)


def other_byte_order(message):
    """As a computer whose numbers begin with the largest byte would send it."""
    kind = "sensor_msgs/msg/PointCloud2"
    return STORE.serialize_cdr(STORE.deserialize_cdr(serialize_message(message), kind), kind, little_endian=False)


def big_endian(message):
    points = np.frombuffer(bytes(message.data), np.dtype([("x", "<f8"), ("n", "<u4")]))
    message.data = points.astype(np.dtype([("x", ">f8"), ("n", ">u4")])).tobytes()
    message.is_bigendian = True
    return message


BYTES = {
    "ours": serialize_message(cloud()),
    "ours, later": serialize_message(cloud(at=8)),
    "ours, after a gap": serialize_message(cloud(dense=False)),
    "longer": serialize_message(cloud(4)),
    "of another stage": serialize_message(cloud(frame="other")),
    "padded": serialize_message(cloud(at=9)) + bytes(3),
    "another order": serialize_message(cloud(layout={"n": "u4", "x": "f8"})),
    "more fields": serialize_message(cloud(layout={**LAYOUT, "y": "f4"})),
    "big-endian data": serialize_message(big_endian(cloud())),
    "other byte order": bytes(other_byte_order(cloud())),
    "other byte order, later": bytes(other_byte_order(cloud(at=8))),
}


def readable(columns):
    values = {name: (values.dtype, values.tolist()) for name, values in columns.values.items()}
    return columns.stamp, columns.frame_id, columns.dense, values


@pytest.mark.parametrize("second", BYTES)
@pytest.mark.parametrize("first", BYTES)
def test_whatever_came_before(first, second):
    reader = CloudReader(LAYOUT)
    for name in (first, second, first):
        expected = read_cloud(deserialize_message(BYTES[name], PointCloud2), LAYOUT)
        assert readable(reader.read(BYTES[name])) == readable(expected)


@pytest.mark.parametrize("size", range(0, 60, 7))
def test_a_message_that_is_cut_is_refused(size):
    reader = CloudReader(LAYOUT)
    reader.read(BYTES["ours"])
    for cut in (BYTES["ours"][:size], BYTES["ours"][:-2]):
        with pytest.raises(RecordError, match="something else"):
            reader.read(cut)
    assert readable(reader.read(BYTES["ours"])) == readable(CloudReader(LAYOUT).read(BYTES["ours"]))


def test_bytes_are_not_changed_by_the_next_block():
    writer = CloudWriter(LAYOUT)
    columns = {"x": np.zeros(2), "n": np.zeros(2, np.uint32)}
    first = writer.write(columns, Time())
    writer.write({"x": np.ones(2), "n": 5}, Time(sec=1))
    assert readable(CloudReader(LAYOUT).read(first))[3]["x"][1] == [0.0, 0.0]
