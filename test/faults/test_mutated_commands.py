"""Commands whose sizes, offsets, types or bytes contradict one another: refused or harmless, and the driver goes on."""

import random

import numpy as np
import pytest
from sensor_msgs.msg import PointCloud2

from benchmarks.mutated_commands import mutated

pytestmark = pytest.mark.nodes

PERIOD = 1e-4


@pytest.mark.parametrize("seed", [1, 2])
def test_mutated_commands_move_nothing_that_was_not_asked_for(lab, seed):
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
