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

"""What is played to a stage stays inside its limits, whatever they are."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from piezo_hysteresis.discrepancy.choice.tiers import spare_drives, tiers
from piezo_hysteresis.identification.protocol.drive_limits import DriveLimits

FIXED = 158.7
"""Stage time of the protocol ``rich`` [s]."""


@settings(max_examples=8, deadline=None)
@given(
    low=st.floats(-100.0, 0.0),
    span=st.floats(1.0, 150.0),
    safe=st.floats(0.0, 1.0),
    slew=st.floats(10.0, 1e6),
    seed=st.integers(0, 2**16),
)
def test_every_sample_is_inside_voltage_and_slew_limits(low, span, safe, slew, seed):
    rate = min(slew * span, 5.0 * span)
    limits = DriveLimits(1e-3, low, low + span, low + safe * span, slew * span, rate)
    for phase in (*(p for tier in tiers(limits, seed) for p in tier.phases), *spare_drives(limits, seed)):
        assert phase.voltage.min() >= limits.voltage_min
        assert phase.voltage.max() <= limits.voltage_max
        steepest = np.abs(np.diff(phase.voltage)).max() / limits.sample_period
        assert steepest <= limits.max_slew_rate * (1 + 1e-6)
        assert phase.voltage[0] == phase.voltage[-1] == limits.safe_voltage


def test_cheap_tiers_come_first_and_all_together_take_less_than_the_fixed_protocol():
    durations = [tier.duration for tier in tiers(DriveLimits(1e-4))]
    assert durations[0] == pytest.approx(12.8, abs=0.5)
    assert durations[2:] == sorted(durations[2:])
    assert max(durations[:2]) < min(durations[2:])
    assert sum(durations) < 0.5 * FIXED


def test_another_seed_is_another_realisation():
    first, second = (tiers(DriveLimits(1e-4), seed)[0] for seed in (1, 2))
    waves = [{p.name: p.voltage for p in tier.phases} for tier in (first, second)]
    assert np.any(waves[0]["noise"] != waves[1]["noise"])
    np.testing.assert_array_equal(waves[0]["triangle"], waves[1]["triangle"])
