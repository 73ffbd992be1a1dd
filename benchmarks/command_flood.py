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

"""A process that sends commands of 16 MB without a pause until it is ended. A driver decodes and refuses them.

scripts/run python -m benchmarks.command_flood --ros-args -r __ns:=/stage_x
"""

from __future__ import annotations

import numpy as np
import rclpy
from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.serialization import serialize_message
from sensor_msgs.msg import PointCloud2

from benchmarks.wire import PERIOD
from piezo_hysteresis.nodes.messages.conversions import command_to_cloud
from piezo_hysteresis.nodes.runtime.qos import COMMAND
from piezo_hysteresis.nodes.runtime.sending import send

SAMPLES = 1_000_000
"""Of one command, 16 bytes each."""


def main() -> None:
    """Flood `command` with a waveform that is valid except for the step at its end."""
    rclpy.init()
    node = Node("flood")
    publisher = node.create_publisher(PointCloud2, "command", COMMAND)
    wave = np.zeros(SAMPLES)
    wave[-1] = 100.0
    packed = serialize_message(command_to_cloud(wave, PERIOD, "flood"))
    while rclpy.ok():
        send(publisher, packed)
        publisher.wait_for_all_acked(Duration(seconds=1.0))


if __name__ == "__main__":
    main()
