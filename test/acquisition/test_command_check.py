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

"""A command is accepted whole or refused whole, with the reason in one line."""

import numpy as np
import pytest

from piezo_hysteresis.acquisition.command_check import CommandCheck
from piezo_hysteresis.errors import PiezoError, StageError
from piezo_hysteresis.nodes.messages.conversions import command_to_cloud, from_stamp, to_stamp, waveform_from_cloud
from piezo_hysteresis.stage.stage import Description

NOW = 1_700_000_000_000_000_000
LIMITS = Description("stage", True, 1e-6, 1.0, 0.0, 10.0, max_slew_rate=1000.0)
CHECK = CommandCheck(LIMITS, 1e-3, 2.0)


def cloud(voltage, period=1e-3, age=0.0):
    return command_to_cloud(voltage, period, "step", to_stamp(NOW - round(age * 1e9)))


def checked(check, message):
    voltage = waveform_from_cloud(message, check.sample_period)
    return check.waveform(voltage, from_stamp(message.header.stamp), NOW)


def test_a_good_command_passes_unchanged():
    wave = np.linspace(0, 10, 50)
    assert np.array_equal(checked(CHECK, cloud(wave, age=1.9)), wave)


@pytest.mark.parametrize(
    ("voltage", "period", "age", "reason"),
    [
        ([0.0, 10.5], 1e-3, 0.0, "10.5 V"),
        ([0.0, -0.1], 1e-3, 0.0, "-0.1 V"),
        ([0.0, 1.1], 1e-3, 0.0, "V/s"),
        ([0.0, np.nan], 1e-3, 0.0, "nan"),
        ([0.0, np.inf], 1e-3, 0.0, "inf"),
        ([], 1e-3, 0.0, "no points"),
        ([0.0] * 9, 2e-3, 0.0, "period of 0.002 s"),
        ([0.0] * 9, 1e-3, 2.1, "2.1 s old"),
        ([0.0] * 9, 1e-3, -2.1, "2.1 s in the future"),
    ],
)
def test_refusals(voltage, period, age, reason):
    with pytest.raises(PiezoError, match=reason) as refusal:
        checked(CHECK, cloud(voltage, period, age))
    assert "\n" not in str(refusal.value)


def test_a_command_without_stamp_has_no_age():
    assert checked(CHECK, command_to_cloud([1.0], 1e-3, "step")).tolist() == [1.0]


def test_first_step_counts_from_the_voltage_in_force():
    CHECK.first_step(np.array([1.0, 9.0]), 0.0)
    with pytest.raises(StageError, match="V/s"):
        CHECK.first_step(np.array([1.1, 1.1]), 0.0)


@pytest.mark.parametrize("voltage", [np.nan, np.inf, -0.01, 10.01])
def test_set_points_outside_are_refused(voltage):
    with pytest.raises(StageError, match="expected 0 to 10 V"):
        CHECK.set_point(voltage)


def test_a_voltage_that_is_a_rounding_error_too_high_is_stated_in_full():
    """'got 10 V, expected 0 to 10 V' was said of it."""
    too_high = float(np.nextafter(10.0, 11.0))
    with pytest.raises(StageError, match=f"sample 0 is {too_high!r} V, expected 0 to 10 V"):
        CHECK.waveform(np.array([too_high]), 0, 0)
    with pytest.raises(StageError, match=f"got {too_high!r} V, expected 0 to 10 V"):
        CHECK.set_point(too_high)


def test_a_replayed_stage_cannot_be_driven():
    check = CommandCheck(Description("replay", True, 1.0, 1.0, 0.0, 1.0, ignores_drive=True), 1.0, 2.0)
    for ask in (lambda: check.set_point(0.5), lambda: checked(check, cloud([0.0], 1.0))):
        with pytest.raises(StageError, match="cannot be driven"):
            ask()
