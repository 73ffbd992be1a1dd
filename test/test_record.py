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

"""Records: what is measured stays what it was, cut or averaged, and what is no measurement is refused."""

from __future__ import annotations

import copy
import pickle

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from piezo_hysteresis.errors import ParameterError, RecordError
from piezo_hysteresis.parameter import Parameter
from piezo_hysteresis.record import Experiment, Record

U, Y = np.linspace(0.0, 5.0, 12), np.linspace(0.0, 1e-5, 12)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Record([], [], 1e-3), "voltage.*sample"),
        (lambda: Record([0.0, np.nan], [0.0, 0.0], 1e-3), "voltage: sample 1 is nan, expected finite"),
        (lambda: Record([0.0, 1.0], [0.0, np.inf], 1e-3), "displacement: sample 1 is inf, expected finite"),
        (lambda: Record([0.0, 1.0], [0.0], 1e-3), "displacement.*2"),
        (lambda: Record([0.0], [0.0], 1e-3, channels={"temperature": [np.nan]}), "temperature: sample 0 is nan"),
        (lambda: Record([0.0], [0.0], 1e-3, channels={"current": [1.0]}), "'current', expected one that holds"),
        (lambda: Record([0.0], [0.0], 1e-3, channels={"voltage": [1.0]}), "channels: got the name 'voltage'"),
        (lambda: Record([0.0], [0.0], 0.0), "sample_period: got 0.0 s, expected a positive time"),
        (lambda: Record([0.0], [0.0], float("nan")), "sample_period: got nan s"),
        (lambda: Record([0.0], [0.0], 1e-3, initial_voltage=float("inf")), "initial_voltage: got inf"),
        (lambda: Record(U, Y, 1e-3)[5:5], "expected a non-empty contiguous part"),
        (lambda: Record(U, Y, 1e-3).decimate(13), "got factor 13, expected 1 to 12"),
        (lambda: Experiment((), "bag"), "'bag' holds no record"),
    ],
)
def test_an_invalid_measurement_is_refused_in_one_line(make, message):
    with pytest.raises(RecordError, match=message) as error:
        make()
    assert "\n" not in str(error.value)
    assert isinstance(error.value, ValueError)


def test_a_record_cannot_be_changed():
    record = Record(U, Y, 1e-3)
    with pytest.raises(ValueError, match="read-only"):
        record.voltage[0] = 1.0
    assert U.flags.writeable


@given(st.sets(st.integers(1, 11)))
def test_parts_put_together_are_the_record(cuts):
    record = Record(U, Y, 1e-3, start_time=2.0, channels={"other_displacement": -Y, "temperature": 290.0 + Y})
    parts = record.split(*sorted(cuts))
    for name in ("voltage", "displacement"):
        np.testing.assert_array_equal(np.concatenate([getattr(p, name) for p in parts]), getattr(record, name))
    for name, values in record.channels.items():
        np.testing.assert_array_equal(np.concatenate([p.channels[name] for p in parts]), values)
    np.testing.assert_allclose(np.concatenate([p.time for p in parts]), record.time, rtol=1e-12)
    assert [p.continues for p in parts] == [False] + [True] * len(cuts)


@settings(max_examples=30)
@given(st.integers(1, 12))
def test_averaging_keeps_mean_duration_and_the_settled_voltage(factor):
    record = Record(U, Y, 1e-3).decimate(factor)
    whole = record.size * factor
    assert record.duration == pytest.approx(whole * 1e-3)
    assert record.voltage.mean() == pytest.approx(U[:whole].mean())
    assert record.displacement.mean() == pytest.approx(Y[:whole].mean())
    assert record.settled_voltage == U[0]


@pytest.mark.parametrize("value", ["five", None, float("nan"), float("inf"), -0.1, 10.1])
def test_a_parameter_outside_its_table_is_refused_with_name_and_unit(value):
    row = Parameter("b", "b", "V", 0.0, 0.0, 10.0, "half width of the play", "play operator")
    with pytest.raises(ParameterError, match=r"backlash\.b: got .*, expected .*V"):
        row.check(value, "backlash.")


def test_an_array_parameter_names_the_element():
    row = Parameter("a", "a", "1", (0.0,), -1.0, 1.0, "coefficients", "ARX")
    with pytest.raises(ParameterError, match=r"a\[1\]: got 2"):
        row.check([0.5, 2.0])
    with pytest.raises(ParameterError, match="expected a sequence of numbers"):
        row.check(0.5)


def test_crossed_bounds_are_no_table():
    with pytest.raises(ParameterError, match="crossed"):
        Parameter("b", "b", "V", 0.0, 1.0, -1.0, "half width of the play", "play operator")


def test_channels_are_frozen_cut_and_sent_to_other_processes():
    record = Record(U, Y, 1e-3, channels={"displacement_3": 2 * Y, "monitor_voltage": U})
    assert "other_displacement" not in record.channels
    with pytest.raises(TypeError):
        record.channels["displacement_3"] = Y
    with pytest.raises(ValueError, match="read-only"):
        record.channels["displacement_3"][0] = 1.0
    for other in (pickle.loads(pickle.dumps(record)), copy.deepcopy(record)):
        assert other.channels.keys() == record.channels.keys()
        np.testing.assert_array_equal(other.channels["displacement_3"], 2 * Y)
    np.testing.assert_array_equal(record[2:5].channels["monitor_voltage"], U[2:5])
    np.testing.assert_array_equal(record.decimate(2).channels["displacement_3"], record.decimate(2).displacement * 2)


def test_a_part_keeps_the_settled_voltage_only_from_the_first_sample() -> None:
    ramp = np.linspace(1.0, 10.0, 10)
    record = Record(ramp, ramp, 1.0, initial_voltage=0.0)
    assert [part.settled_voltage for part in (record[:5], record[5:], *record.split(3))] == [0.0, 6.0, 0.0, 4.0]
