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

"""Commands whose sizes, offsets, types or bytes contradict one another: for tests and for the soak."""

from __future__ import annotations

import random

import numpy as np
from rclpy.serialization import serialize_message

from piezo_hysteresis.nodes.messages.conversions import command_to_cloud

HIGHEST = 0.01
"""Largest voltage of the commands before they are changed [V], which limits the motion by those that remain valid."""
SIZES = (0, 1, 7, 8, 15, 16, 2**16, 2**31, 2**32 - 1)


def mutated(chance: random.Random, sample_period: float) -> bytes:
    """A command with sizes, offsets, types or bytes that contradict one another."""
    wave = np.linspace(0, HIGHEST, chance.randint(2, 50))
    cloud = command_to_cloud(wave, sample_period, f"mutated_{chance.randint(0, 9)}")
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
