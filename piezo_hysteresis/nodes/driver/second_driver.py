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

"""`refuse_second_driver`: raises an error where the namespace has a driver already, on this machine or another one."""

from __future__ import annotations

import time

from rclpy.node import Node
from rclpy.wait_for_message import wait_for_message
from sensor_msgs.msg import PointCloud2

from ...errors import StageError
from ..runtime.qos import SAMPLES

_SILENCE = 1.0
"""Time without a block after which a publisher of samples counts as dead [s]."""


def refuse_second_driver(node: Node, discovery_time: float) -> None:
    """Look for another driver that sends samples.

    Parameters
    ----------
    node : Node
        The driver node.
    discovery_time : float
        Time for which other publishers are looked for [s].

    Raises
    ------
    StageError
        If another publisher sends samples. A silent publisher counts as a driver that was killed.
    """
    deadline = time.monotonic() + discovery_time
    while node.count_publishers("samples") == 0:
        if time.monotonic() > deadline:
            return
        time.sleep(0.02)
    sends, _ = wait_for_message(PointCloud2, node, "samples", qos_profile=SAMPLES, time_to_wait=_SILENCE)
    if sends:
        topic = node.resolve_topic_name("samples")
        raise StageError(f"{topic} is published by another driver; stop that one or take another namespace")
    node.get_logger().warning(
        "another publisher of samples exists but is silent; it is taken for a driver that was killed"
    )
