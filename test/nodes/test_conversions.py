"""Blocks and waveforms survive the way through a message; foreign clouds are read by name or refused in one line."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import PointCloud2, PointField

from piezo_hysteresis.errors import PiezoError, RecordError
from piezo_hysteresis.nodes import cloud, conversions
from piezo_hysteresis.nodes.phase_text import phase_from_text, phase_name

finite = st.floats(allow_nan=False, allow_infinity=False)


def block_of(n, first_index=0, **changes):
    values = {
        "stamp": 1_700_000_000_123_456_789,
        "time": 2e-5 * np.arange(n),
        "voltage": np.linspace(0, 10, n),
        "displacement": np.linspace(0, 1e-5, n),
        "index": (first_index + np.arange(n)).astype(np.uint32),
        "phase": np.full(n, 7, np.uint32),
        "stage": "simulated",
    }
    return conversions.SampleBlock(**{**values, **changes})


def over_the_wire(message):
    return deserialize_message(serialize_message(message), type(message))


@settings(deadline=None)
@given(hnp.arrays(np.float64, st.integers(1, 50), elements=st.floats(-1, 1)), st.integers(0, 2**32 - 1), st.booleans())
def test_samples_come_back_bit_for_bit(displacement, first, gap):
    block = block_of(displacement.size, first, displacement=displacement, follows_gap=gap)
    back = conversions.samples_from_cloud(over_the_wire(conversions.samples_to_cloud(block)))
    for name in ("time", "voltage", "displacement", "index", "phase"):
        assert np.array_equal(getattr(back, name), getattr(block, name))
    assert (back.stamp, back.stage, back.follows_gap) == (block.stamp, block.stage, gap)


def test_samples_layout_is_the_published_one():
    message = conversions.samples_to_cloud(block_of(3))
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


@given(hnp.arrays(np.float64, st.integers(1, 50), elements=finite))
def test_waveform_comes_back_bit_for_bit(voltage):
    message = over_the_wire(conversions.command_to_cloud(voltage, 2e-5, "triangle"))
    assert np.array_equal(conversions.waveform_from_cloud(message, 2e-5), voltage)
    assert phase_name(message.header.frame_id) == "triangle"


@pytest.mark.parametrize("factor", [0.5, 1.001, 2.0])
def test_waveform_of_another_period_is_refused(factor):
    message = conversions.command_to_cloud(np.zeros(100), 2e-5 * factor, "step")
    with pytest.raises(RecordError, match="period"):
        conversions.waveform_from_cloud(message, 2e-5)


def test_foreign_order_endianness_and_narrow_types_are_read():
    dtype = np.dtype({"names": ["voltage", "spare"], "formats": [">f4", ">i2"], "offsets": [6, 0], "itemsize": 12})
    points = np.zeros(4, dtype)
    points["voltage"] = [0.0, 0.5, 1.0, -2.25]
    message = PointCloud2(height=1, width=4, point_step=12, row_step=48, is_bigendian=True)
    message.fields = [
        PointField(name="spare", offset=0, datatype=PointField.INT16, count=1),
        PointField(name="voltage", offset=6, datatype=PointField.FLOAT32, count=1),
    ]
    message.data = points.tobytes()
    assert np.array_equal(conversions.waveform_from_cloud(message, 1.0), [0.0, 0.5, 1.0, -2.25])


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
    message = spoil(conversions.samples_to_cloud(block_of(10)), what)
    with pytest.raises(RecordError, match="expected") as refusal:
        conversions.samples_from_cloud(message)
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
    message = conversions.samples_to_cloud(block_of(4, **changes))
    if reason is None:
        assert conversions.samples_from_cloud(message).sample_period == 0.0
        return
    with pytest.raises(RecordError, match=reason):
        conversions.samples_from_cloud(message)


def test_an_index_that_wraps_is_consecutive():
    block = block_of(10, 2**32 - 5)
    assert np.array_equal(conversions.samples_from_cloud(conversions.samples_to_cloud(block)).index, block.index)


def test_a_stamp_with_a_second_of_nanoseconds_is_refused():
    message = conversions.command_to_cloud([0.0], 1.0, "step")
    message.header.stamp.nanosec = 4_000_000_000
    with pytest.raises(RecordError, match="less than a second"):
        conversions.from_stamp(message.header.stamp)


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("name", ["time", "voltage", "displacement"])
def test_non_finite_samples_are_refused(name, value):
    values = np.linspace(0, 1, 10)
    values[4] = value
    message = conversions.samples_to_cloud(block_of(10, **{name: values}))
    with pytest.raises(RecordError, match=rf"{name} 4 is"):
        conversions.samples_from_cloud(message)


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
        block = conversions.samples_from_cloud(message)
    except PiezoError:
        return
    assert block.size == width * height
    assert np.isfinite(block.displacement).all()


@pytest.mark.parametrize("name", ["../etc", "a b", "x" * 65, "a\nb", "-x"])
def test_phase_names_that_could_not_name_a_file_are_refused(name):
    with pytest.raises(RecordError):
        phase_name(name)


def test_phase_text_round_trip_and_refusal():
    assert phase_from_text("12 sine_50hz") == (12, "sine_50hz")
    for text in ("", "12", "x y", "-1 rest", "² rest"):
        with pytest.raises(RecordError):
            phase_from_text(text)


def test_predicted_samples_layout():
    block = block_of(4)
    message = conversions.predicted_to_cloud(block, block.displacement, np.zeros(4), 0xDEADBEEF, valid=False)
    arrays = cloud.from_cloud(message, {"prediction": "f8", "residual": "f8", "model": "u4", "index": "u4"})
    assert arrays["model"].tolist() == [0xDEADBEEF] * 4
    assert np.array_equal(arrays["index"], block.index)
    assert message.point_step == 40
    assert not message.is_dense


def test_diagnostic_values_and_stamps():
    status = conversions.diagnostic(b"\x01", "n", "m", "h", state="playing", first_index=3, rate=1 / 3)
    assert conversions.values_of(status) == {"state": "playing", "first_index": "3", "rate": "0.333333"}
    assert conversions.from_stamp(conversions.to_stamp(1_700_000_000_999_999_999)) == 1_700_000_000_999_999_999
