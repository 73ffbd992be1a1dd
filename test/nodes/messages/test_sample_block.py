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

"""Blocks survive the way through a message, as an object or as bytes; what is no block is refused in one line."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import PointCloud2, PointField

from piezo_hysteresis.errors import PiezoError, RecordError
from piezo_hysteresis.nodes.messages.cloud import from_cloud
from piezo_hysteresis.nodes.messages.samples import (
    PredictionWriter,
    SampleBlock,
    SampleReader,
    SampleWriter,
    samples_from_cloud,
    samples_to_cloud,
)


def block_of(n, first_index=0, **changes):
    values = {
        "stamp": 1_700_000_000_123_456_789,
        "time": 2e-5 * np.arange(n),
        "voltage": np.linspace(0, 10, n),
        "displacement": np.linspace(0, 1e-5, n),
        "index": (first_index + np.arange(n)).astype(np.uint32),
        "phase": np.full(n, 7, np.uint32),
        "frame": "simulated",
    }
    return SampleBlock(**{**values, **changes})


def outcome(read, message):
    """Everything that a block says, or the refusal."""
    try:
        block = read(message)
    except RecordError as error:
        return str(error)
    return block.stamp, block.frame, block.follows_gap, [values.tolist() for values in block.columns.values()]


def read(message):
    """Block of a message; serialised it says the same, the first one of a stream, the next one, and one like it."""
    fresh, running = SampleReader(), SampleReader()
    running.read(SampleWriter().write(block_of(10)))
    raw = serialize_message(message)
    outcomes = [outcome(samples_from_cloud, message), *(outcome(one.read, raw) for one in (fresh, running, fresh))]
    assert outcomes[1:] == outcomes[:-1]
    return samples_from_cloud(message)


@given(hnp.arrays(np.float64, st.integers(1, 50), elements=st.floats(-1, 1)), st.integers(0, 2**32 - 1), st.booleans())
def test_samples_come_back_bit_for_bit(displacement, first, gap):
    block = block_of(displacement.size, first, displacement=displacement, follows_gap=gap)
    back = read(samples_to_cloud(block))
    assert {name: values.tobytes() for name, values in back.columns.items()} == {
        name: values.tobytes() for name, values in block.columns.items()
    }
    assert (back.stamp, back.frame, back.follows_gap) == (block.stamp, block.frame, gap)


@given(st.lists(st.tuples(st.integers(1, 5), st.text(max_size=6), st.integers(0, 2**31 * 10**9 - 1), st.booleans())))
def test_a_stream_reads_the_same_as_single_messages(changes):
    writer, reader = SampleWriter(), SampleReader()
    for size, stage, stamp, gap in changes:
        block = block_of(size, frame=stage.replace("\0", ""), stamp=stamp, follows_gap=gap)
        raw = writer.write(block)
        cloud = samples_to_cloud(block)
        assert deserialize_message(raw, PointCloud2) == cloud
        assert len(raw) == len(serialize_message(cloud))
        assert outcome(reader.read, raw) == outcome(samples_from_cloud, cloud)


def test_samples_layout_is_the_published_one():
    message = samples_to_cloud(block_of(3))
    assert [(f.name, f.offset, f.datatype, f.count) for f in message.fields] == [
        ("time", 0, PointField.FLOAT64, 1),
        ("voltage", 8, PointField.FLOAT64, 1),
        ("displacement", 16, PointField.FLOAT64, 1),
        ("index", 24, PointField.UINT32, 1),
        ("phase", 28, PointField.UINT32, 1),
    ]
    assert (message.point_step, message.is_bigendian, message.height, message.width) == (32, False, 1, 3)


def test_sample_period_is_that_of_the_time_field():
    assert block_of(5).sample_period == pytest.approx(2e-5, rel=1e-12)
    assert block_of(1).sample_period is None


def spoil(message, what):
    if what == "truncated":
        message.data = message.data[:-1]
    elif what == "empty":
        message.width = 0
        message.data = b""
    elif what == "claims more":
        message.width = 4_000_000_000
    elif what == "no field":
        message.fields = [f for f in message.fields if f.name != "displacement"]
    elif what == "outside":
        message.fields[2].offset = 30
    elif what == "huge offset":
        message.fields[2].offset = 2**32 - 1
    elif what == "unknown type":
        message.fields[2].datatype = 99
    elif what == "vector":
        message.fields[2].count = 3
    elif what == "float index":
        message.fields[3].datatype = PointField.FLOAT32
    elif what == "no step":
        message.point_step = 0
    return message


@pytest.mark.parametrize(
    "what",
    ["truncated", "empty", "claims more", "no field", "outside", "huge offset", "unknown type", "vector"]
    + ["float index", "no step"],
)
def test_a_broken_cloud_is_refused_in_one_line(what):
    message = spoil(samples_to_cloud(block_of(10)), what)
    with pytest.raises(RecordError, match="expected") as refusal:
        read(message)
    assert "\n" not in str(refusal.value)


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"index": np.array([0, 1, 2, 4], np.uint32)}, "index jumps"),
        ({"index": np.array([3, 2, 1, 0], np.uint32)}, "index jumps"),
        ({"time": np.array([0.0, 1.0, 2.0, 3.5])}, "even"),
        ({"time": -np.arange(4.0)}, "even"),
        ({"time": np.zeros(4)}, None),
        ({"time": np.full(4, 1e300)}, "expected a date"),
        ({"time": np.array([0.0, 1e308, -1e308, 3.0])}, "even"),
        ({"voltage": np.array([0.0, -1e300, 0.0, 0.0])}, "voltage of -1e"),
        ({"displacement": np.array([0.0, 0.0, 1.5, 0.0])}, "displacement of 1.5"),
        ({"stamp": (2**31 - 1) * 10**9, "time": np.arange(4.0)}, "expected a date"),
    ],
)
def test_a_block_is_consecutive_even_and_has_a_date(changes, reason):
    """What would break a node that counts on it further on."""
    message = samples_to_cloud(block_of(4, **changes))
    if reason is None:
        assert read(message).sample_period == 0.0
        return
    with pytest.raises(RecordError, match=reason):
        read(message)


def test_an_index_that_wraps_is_consecutive():
    block = block_of(10, 2**32 - 5)
    assert np.array_equal(read(samples_to_cloud(block)).index, block.index)


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("name", ["time", "voltage", "displacement"])
def test_non_finite_samples_are_refused(name, value):
    values = np.linspace(0, 1, 10)
    values[4] = value
    message = samples_to_cloud(block_of(10, **{name: values}))
    with pytest.raises(RecordError, match=rf"{name} 4 is"):
        read(message)


@given(
    st.lists(
        st.tuples(
            st.sampled_from(["time", "voltage", "displacement", "index", "phase", "x"]), st.integers(0, 2**32 - 1)
        ).flatmap(
            lambda t: st.tuples(st.just(t[0]), st.integers(0, 40) | st.just(t[1]), st.integers(0, 9), st.integers(0, 2))
        ),
        max_size=7,
    ),
    st.integers(0, 40),
    st.integers(0, 3),
    st.integers(0, 3),
    st.binary(max_size=128),
    st.booleans(),
)
def test_any_cloud_gives_arrays_or_our_error(fields, step, width, height, data, big):
    message = PointCloud2(
        height=height, width=width, point_step=step, row_step=step * width, is_bigendian=big, data=data
    )
    message.fields = [PointField(name=n, offset=o, datatype=d, count=c) for n, o, d, c in fields]
    try:
        block = read(message)
    except PiezoError:
        return
    assert block.size == width * height
    assert np.isfinite(block.displacement).all()


def test_predicted_samples_layout():
    block = block_of(4)
    results = {"prediction": block.displacement, "residual": np.zeros(4)}
    written = PredictionWriter().write(block, results, 0xDEADBEEF, valid=False)
    message = deserialize_message(written, PointCloud2)
    arrays = from_cloud(message, {"prediction": "f8", "residual": "f8", "model": "u4", "index": "u4"})
    assert arrays["model"].tolist() == [0xDEADBEEF] * 4
    assert np.array_equal(arrays["index"], block.index)
    assert message.point_step == 40
    assert not message.is_dense
