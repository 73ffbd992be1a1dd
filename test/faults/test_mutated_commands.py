"""Commands whose sizes, offsets, types or bytes contradict one another: refused or harmless, and the driver goes on."""

import random

import numpy as np
import pytest
from rclpy.serialization import serialize_message
from sensor_msgs.msg import PointCloud2

from piezo_hysteresis.nodes.messages.conversions import command_to_cloud

pytestmark = pytest.mark.nodes

PERIOD = 1e-4
SIZES = (0, 1, 7, 8, 15, 16, 2**16, 2**31, 2**32 - 1)


def mutated(chance):
    """A command with sizes, offsets, types or bytes that contradict one another."""
    cloud = command_to_cloud(np.linspace(0, 0.01, chance.randint(2, 50)), PERIOD, f"mutated_{chance.randint(0, 9)}")
    for _ in range(chance.randint(1, 3)):
        field = chance.choice(cloud.fields)
        match chance.randint(0, 7):
            case 0:
                cloud.width = chance.choice(SIZES)
            case 1:
                cloud.height = chance.choice(SIZES)
            case 2:
                cloud.point_step = chance.choice(SIZES)
            case 3:
                cloud.row_step = chance.choice(SIZES)
            case 4:
                field.offset = chance.choice(SIZES)
            case 5:
                field.count = chance.choice(SIZES)
            case 6:
                field.datatype = chance.randint(0, 255)
            case _:
                field.name = chance.choice(["", "voltage", "time", "x\x1b[2J", "voltage\x00"])
    message = bytearray(serialize_message(cloud))
    if chance.random() < 0.3:
        del message[chance.randint(4, len(message)) :]
    if chance.random() < 0.3:
        message[chance.randrange(4, len(message)) if len(message) > 5 else 0] ^= 1 << chance.randint(0, 7)
    return bytes(message)


@pytest.mark.parametrize("seed", [1, 2])
def test_mutated_commands_move_nothing_that_was_not_asked_for(lab, seed):
    driver = lab.driver(sample_period=PERIOD)
    samples, command = lab.streaming(), lab.publisher(PointCloud2, "command")
    chance = random.Random(seed)
    for _ in range(500):
        command.publish(mutated(chance))
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
