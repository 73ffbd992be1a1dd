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

"""Bags of other software: channels from any topic and field."""

import numpy as np
import pytest
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from piezo_hysteresis.errors import RecordingError
from piezo_hysteresis.recording import read

PERIOD_NS = 1_000_000
N = 300
TIME = np.arange(N) * 1e-3
VOLTAGE = 2.0 + np.sin(2 * np.pi * 10 * TIME)
DISPLACEMENT = 12.5 * VOLTAGE


@pytest.fixture
def store():
    store = get_typestore(Stores.ROS2_KILTED)
    store.register(get_types_from_msg("std_msgs/Header header\nlab_msgs/Gauge gauge\n", "lab_msgs/msg/Reading"))
    store.register(get_types_from_msg("float32 value\nfloat64[] block\n", "lab_msgs/msg/Gauge"))
    return store


def bag_of(path, store, messages):
    """Write (topic, type, time_ns, message) in order."""
    with Writer(path, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        topics = {}
        for topic, kind, time_ns, message in messages:
            if topic not in topics:
                topics[topic] = writer.add_connection(topic, kind, typestore=store)
            writer.write(topics[topic], time_ns, store.serialize_cdr(message, kind))
    return path


def header(store, time_ns):
    stamp = store.types["builtin_interfaces/msg/Time"](*divmod(time_ns, 10**9))
    return store.types["std_msgs/msg/Header"](stamp, "")


def test_two_float_topics_are_paired_by_time_of_reception(tmp_path, store):
    number = store.types["std_msgs/msg/Float64"]
    messages = []
    for k in range(N):
        at = 10**9 + k * PERIOD_NS
        messages.append(("/ao/voltage", "std_msgs/msg/Float64", at, number(VOLTAGE[k])))
        messages.append(("/sensor", "std_msgs/msg/Float64", at + PERIOD_NS // 3, number(DISPLACEMENT[k])))
    path = bag_of(tmp_path / "bag", store, messages)
    experiment = read(
        path,
        columns={"voltage": "/ao/voltage", "displacement": "/sensor.data"},
        units={"displacement": "um"},
        phases="x",
    )
    (record,) = experiment
    np.testing.assert_array_equal(record.voltage, VOLTAGE)
    np.testing.assert_allclose(record.displacement, DISPLACEMENT * 1e-6, rtol=1e-12)
    assert record.sample_period == 1e-3
    assert {"held", "time_base"} <= {n.kind for n in experiment.notices}


def test_elements_of_a_joint_state_share_their_stamp(tmp_path, store):
    kind = "sensor_msgs/msg/JointState"
    messages = [
        (
            "/axes",
            kind,
            10**9 + 7 * k,  # received in a burst: the stamps count
            store.types[kind](
                header(store, 10**9 + k * PERIOD_NS),
                ["u", "y"],
                np.array([VOLTAGE[k], DISPLACEMENT[k]]),
                np.zeros(0),
                np.zeros(0),
            ),
        )
        for k in range(N)
        if not 100 <= k < 120
    ]
    path = bag_of(tmp_path / "bag", store, messages)
    experiment = read(path, columns={"voltage": "/axes.position[0]", "displacement": "/axes.position[1]"}, phases="x")
    assert [(r.size, r.truncated) for r in experiment] == [(100, False), (N - 120, True)]
    np.testing.assert_array_equal(experiment[1].displacement, DISPLACEMENT[120:])
    assert experiment[1].start_time == pytest.approx(0.120)
    assert "gap" in {n.kind for n in experiment.notices}


def test_types_defined_only_in_the_bag_and_blocks_of_samples(tmp_path, store):
    kind = "lab_msgs/msg/Reading"
    gauge = store.types["lab_msgs/msg/Gauge"]
    messages = []
    for k in range(0, N, 10):
        stamp = header(store, 10**9 + k * PERIOD_NS)
        for topic, values in (("/u", VOLTAGE), ("/y", DISPLACEMENT)):
            messages.append((topic, kind, k, store.types[kind](stamp, gauge(0.0, values[k : k + 10]))))
    path = bag_of(tmp_path / "bag", store, messages)
    columns = {"voltage": "/u.gauge.block", "displacement": "/y.gauge.block"}
    with pytest.raises(RecordingError, match="give `sample_period`"):
        read(path, columns=columns)
    (record,) = read(path, columns=columns, sample_period=1e-3, phases="x")
    np.testing.assert_array_equal(record.voltage, VOLTAGE)
    np.testing.assert_array_equal(record.displacement, DISPLACEMENT)


@pytest.mark.parametrize(
    ("columns", "says"),
    [
        ({"voltage": "/nothing", "displacement": "/sensor"}, "no message on /nothing"),
        ({"voltage": "/sensor.volts", "displacement": "/sensor"}, "no numbers at 'volts'"),
        ({"voltage": "/sensor"}, "expected voltage and displacement"),
        ({"voltage": "/sensor.[", "displacement": "/sensor"}, r"expected /topic\.field"),
        ({}, "map foreign topics"),
    ],
)
def test_missing_topics_are_reported(tmp_path, store, columns, says):
    number = store.types["std_msgs/msg/Float64"]
    path = bag_of(tmp_path / "bag", store, [("/sensor", "std_msgs/msg/Float64", k, number(1.0)) for k in range(5)])
    with pytest.raises(RecordingError, match=says):
        read(path, columns=columns)
