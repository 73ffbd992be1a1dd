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

"""Blocks and waveforms survive the way through a message; foreign clouds are read by name or refused in one line."""

import itertools

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticStatus
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import PointCloud2, PointField

from piezo_hysteresis.errors import RecordError
from piezo_hysteresis.nodes.messages import conversions
from piezo_hysteresis.nodes.messages.cloud import to_cloud
from piezo_hysteresis.nodes.messages.phase_text import phase_name, phase_text

finite = st.floats(allow_nan=False, allow_infinity=False)


def over_the_wire(message):
    return deserialize_message(serialize_message(message), type(message))


@given(st.integers(0, 2**63 - 1))
def test_every_date_of_a_clock_has_a_message_time(nanoseconds):
    """Messages hold dates before 2038-01-19, 03:14:08 UTC; later ones become the last of them."""
    stamp = over_the_wire(conversions.to_stamp(nanoseconds))
    assert conversions.from_stamp(stamp) == min(nanoseconds, 2**31 * 10**9 - 1)


def test_what_is_wrong_counts_more_than_what_is_unknown():
    """The numbers of the levels are not in this order: that of STALE is the largest."""
    good, unknown, warning, error = (getattr(DiagnosticStatus, name) for name in ("OK", "STALE", "WARN", "ERROR"))
    for levels in itertools.permutations((good, unknown, warning, error)):
        assert conversions.worst(*levels) == error
    assert conversions.worst(unknown, warning) == conversions.worst(warning, unknown) == warning
    assert conversions.worst(good, unknown) == unknown
    assert conversions.worst(good) == good


@given(hnp.arrays(np.float64, st.integers(1, 50), elements=finite))
def test_a_waveform_is_converted_and_back_bit_for_bit(voltage):
    message = over_the_wire(conversions.command_to_cloud(voltage, 2e-5, "triangle"))
    assert np.array_equal(conversions.waveform_from_cloud(message, 2e-5), voltage)
    assert conversions.phase_text_of(message, "") == "triangle"
    assert message.header.frame_id == ""


@pytest.mark.parametrize(
    ("fields", "frame_id", "name"),
    [
        (["voltage", "phase:triangle"], "", "triangle"),
        (["voltage", "phase:triangle@scanner"], "stage_x", "triangle@scanner"),
        (["voltage", "phase:triangle"], "sine", "triangle"),
        (["phase:sine", "voltage", "phase:step"], "", "sine"),
        (["voltage"], "triangle", "triangle"),  # senders that name the phase in frame_id
        (["voltage"], "stage_x", ""),  # the frame of the axis is no name of a phase
        (["voltage"], "", ""),
    ],
)
def test_a_phase_is_named_by_a_field_or_by_frame_id(fields, frame_id, name):
    assert phase_text(fields, frame_id, "stage_x") == name


@pytest.mark.parametrize("last", [1e308, -1e308])
def test_impossible_times_are_refused_without_a_warning(last):
    columns = {"voltage": np.zeros(2), "time": np.array([-last, last])}
    message = over_the_wire(to_cloud(columns, {"voltage": "f8", "time": "f8"}, conversions.to_stamp(0), ""))
    with pytest.raises(RecordError, match="time: got a period"):
        conversions.waveform_from_cloud(message, 2e-5)


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


def test_a_stamp_with_a_second_of_nanoseconds_is_refused():
    message = conversions.command_to_cloud([0.0], 1.0, "step")
    message.header.stamp.nanosec = 4_000_000_000
    with pytest.raises(RecordError, match="less than a second"):
        conversions.from_stamp(message.header.stamp)


@pytest.mark.parametrize("name", ["../etc", "a b", "x" * 65, "a\nb", "-x"])
def test_phase_names_that_could_not_name_a_file_are_refused(name):
    with pytest.raises(RecordError):
        phase_name(name)


def test_diagnostic_values_and_stamps():
    status = conversions.diagnostic(b"\x01", "n", "m", "h", state="playing", first_index=3, rate=1 / 3)
    assert conversions.values_of(status) == {"state": "playing", "first_index": "3", "rate": "0.333333"}
    assert conversions.from_stamp(conversions.to_stamp(1_700_000_000_999_999_999)) == 1_700_000_000_999_999_999
