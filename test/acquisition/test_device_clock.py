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

"""The stamps follow the clock of a device, whatever the jitter of the computer."""

import numpy as np
import pytest

from piezo_hysteresis.acquisition.device_clock import DeviceClock
from piezo_hysteresis.acquisition.time_base import TimeBase

PERIOD, BLOCK = 2e-5, 500


@pytest.mark.parametrize("drift", [2e-4, -2e-4])
def test_two_quartz_clocks_that_part_stay_together_within_the_tolerance(drift):
    rng = np.random.default_rng(1)
    base = TimeBase(PERIOD)
    clock = DeviceClock(base)
    apart = []
    for end in range(BLOCK, 60_000 * BLOCK // 2, BLOCK):  # five minutes
        taken = end * PERIOD * (1 + drift)
        clock.follow(end, taken + rng.exponential(5e-4))
        apart.append(base.due(end) - taken)
    assert np.abs(apart).max() < 1.5 * base.tolerance
    assert abs(end * PERIOD * drift) > 50 * base.tolerance


def test_equal_clocks_need_no_correction():
    rng = np.random.default_rng(2)
    base = TimeBase(PERIOD)
    clock = DeviceClock(base)
    ends = range(BLOCK, 5000 * BLOCK, BLOCK)
    assert not any(clock.follow(end, end * PERIOD + rng.exponential(2e-3)) for end in ends)
