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


import numpy as np
import pytest

from piezo_hysteresis.recording.checks.split_at_gaps import split_at_gaps

PERIOD = 1e-3
TIME = PERIOD * np.arange(4000)
RNG = np.random.default_rng(0)
SINE = 5.0 - 4.0 * np.cos(2.0 * np.pi * TIME)
TRIANGLE = np.abs((TIME + 0.5) % 2.0 - 1.0)
HELD = np.where(TIME < 1.0, 0.0, 5.0)
NOISE = 2.0 * RNG.standard_normal(TIME.size)


def records(voltage, start, missing, as_nan, noise=0.0):
    """What is read where `missing` samples from `start` on are not finite, or have no row."""
    displacement = 1e-6 * (voltage + noise * np.random.default_rng(1).standard_normal(TIME.size))
    gap = slice(start, start + missing)
    if as_nan:
        displacement[gap] = np.nan
        return split_at_gaps({"voltage": voltage, "displacement": displacement}, PERIOD)
    rows = {"voltage": voltage, "displacement": displacement, "temperature": 293.0 + TIME}
    return split_at_gaps({name: np.delete(c, gap) for name, c in rows.items()}, PERIOD, {start: missing})


@pytest.mark.parametrize("as_nan", [False, True])
@pytest.mark.parametrize("noise", [0.0, 0.02])
@pytest.mark.parametrize(("start", "missing"), [(1250, 1), (1250, 20), (1000, 3), (3700, 50)])
def test_a_short_gap_in_a_smooth_drive_is_interpolated_and_reported(start, missing, as_nan, noise):
    (record,), notices = records(SINE, start, missing, as_nan, noise)
    assert record.size == TIME.size and not record.truncated
    np.testing.assert_allclose(record.voltage, SINE, atol=0.01)
    np.testing.assert_allclose(record.displacement, 1e-6 * SINE, atol=1e-6 * (0.01 + 5.0 * noise))
    (message,) = [n.message for n in notices if n.kind == "interpolated"]
    assert message.startswith(f"{missing} lost samples") and f"{TIME[start]:g} s" in message
    if not as_nan:
        np.testing.assert_allclose(record.channels["temperature"], 293.0 + TIME)


@pytest.mark.parametrize("as_nan", [False, True])
@pytest.mark.parametrize(
    ("voltage", "start", "missing"),
    [(TRIANGLE, 1490, 20), (NOISE, 2000, 1), (HELD, 995, 10), (SINE, 1200, 300), (SINE, 2, 1)],
)
def test_other_gaps_split_the_record(voltage, start, missing, as_nan):
    parts, notices = records(voltage, start, missing, as_nan)
    assert parts[-1].truncated
    assert parts[-1].start_time == pytest.approx((start + missing) * PERIOD)
    np.testing.assert_array_equal(parts[-1].voltage, voltage[start + missing :])
    assert "interpolated" not in {n.kind for n in notices}


def test_the_state_continues_over_a_gap_in_a_held_voltage():
    (before, after), _ = records(HELD, 2000, 300, as_nan=False)
    assert after.continues and not after.truncated
    assert after.start_time == pytest.approx(before.duration + 300 * PERIOD)


def test_many_short_gaps_leave_one_record():
    displacement = 1e-6 * SINE
    displacement[RNG.choice(np.arange(100, 3900), 40, replace=False)] = np.nan
    (record,), _ = split_at_gaps({"voltage": SINE, "displacement": displacement}, PERIOD)
    np.testing.assert_allclose(record.displacement, 1e-6 * SINE, atol=1e-9)
