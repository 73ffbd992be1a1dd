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

"""The last line of defence: a stage plays nothing that breaks its limits, and clips nothing."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from piezo_hysteresis.errors import StageError
from piezo_hysteresis.stage.description import Description

DEVICE = Description(
    name="device", streaming=True, sample_period_min=50e-6, sample_period_max=1.0, sample_period_step=50e-6,
    voltage_min=-1.0, voltage_max=7.5, max_slew_rate=1000.0, longest_block=1000,
)  # fmt: skip


@given(st.lists(st.floats(-1.0, 7.5), min_size=1, max_size=20))
def test_a_drive_within_limits_passes_unchanged(levels):
    gentle = np.interp(np.arange(200), np.linspace(0, 199, len(levels)), levels)
    start = float(gentle[0])
    np.testing.assert_array_equal(DEVICE.check_voltage(gentle, start, 10e-3), gentle)


@pytest.mark.parametrize(
    ("voltage", "says"),
    [
        ([0.0, 7.6], "sample 1 is 7.6 V"),
        ([0.0, -1.01], "-1.01 V"),
        ([0.0, float("nan")], "nan V"),
        ([0.0, float("inf")], "inf V"),
        ([], "not empty"),
        ([[0.0]], "one dimension"),
        ("high", "array of volts"),
        (np.zeros(1001), "at most 1000"),
        ([0.0, 0.04, 0.2], "sample 2 steps by 0.16 V"),
        ([2.0], "sample 0 steps by 2 V"),
        ([2.0], "from the present voltage of 0 V.*move the stage to 2 V first"),
    ],
)
def test_a_drive_outside_limits_is_refused_whole(voltage, says):
    with pytest.raises(StageError, match=says) as error:
        DEVICE.check_voltage(voltage, 0.0, 50e-6)
    assert "expected" in str(error.value)


@pytest.mark.parametrize("period", [50e-6, 100e-6, 0.35, 1.0])
def test_whole_multiples_of_the_period_step_are_accepted(period):
    assert DEVICE.check_sample_period(period) == period


@pytest.mark.parametrize("period", [20e-6, 75e-6, 1.1, 0.0, -50e-6, float("nan")])
def test_other_sample_periods_are_refused(period):
    with pytest.raises(StageError, match="sample period"):
        DEVICE.check_sample_period(period)


@pytest.mark.parametrize(
    "wrong",
    [
        {"voltage_min": 2.0},
        {"safe_voltage": 9.0},
        {"sample_period_min": 0.0},
        {"max_slew_rate": 0.0},
        {"displacement_min": 1.0, "displacement_max": 0.0},
    ],
)
def test_crossed_limits_are_refused_in_a_description(wrong):
    sound = {
        "name": "device", "streaming": True, "sample_period_min": 1e-3, "sample_period_max": 1.0, "voltage_min": 0.0,
        "voltage_max": 1.0,
    }  # fmt: skip
    Description(**sound)
    with pytest.raises(StageError, match="expected"):
        Description(**{**sound, **wrong})
