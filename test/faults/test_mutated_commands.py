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

"""Commands whose sizes, offsets, types or bytes contradict one another: refused or harmless, and the driver goes on."""

import random

import numpy as np
import pytest
from sensor_msgs.msg import PointCloud2

from benchmarks.mutated_commands import mutated

pytestmark = pytest.mark.nodes

PERIOD = 1e-4


@pytest.mark.parametrize("seed", [1, 2])
def test_mutated_commands_never_cause_other_motion(lab, seed):
    driver = lab.driver(sample_period=PERIOD)
    samples, command = lab.streaming(), lab.publisher(PointCloud2, "command")
    chance = random.Random(seed)
    for _ in range(500):
        command.publish(mutated(chance, PERIOD))
        lab.pause(0.002)
    statuses = lab.statuses()

    def played():
        lab.send(np.zeros(100), "after", PERIOD)
        lab.pause(0.2)
        return "done" in lab.states(statuses, "after")

    lab.wait(played, "a good command after them")
    assert driver.is_running
    seen = samples.so_far()
    assert np.abs(seen.voltage).max() < 0.02
    assert len(driver.output) < 200_000
