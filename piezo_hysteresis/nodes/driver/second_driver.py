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
from collections.abc import Callable
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.node import Node
from sensor_msgs.msg import PointCloud2

from ...errors import StageError
from ..runtime.qos import SAMPLES
from ..topics import DIAGNOSTICS, TOPICS
from .diagnostics import status_name

_SILENCE = 2.5
"""Time without a sign of life after which a publisher of samples counts as dead [s]: two reports on /diagnostics."""

_INTERVAL = 0.02
"""Time between two looks [s]."""


def refuse_second_driver(node: Node, discovery_time: float) -> None:
    """Look for another driver of the same namespace. Blocks until it is found, or is known to be dead or absent.

    A driver that plays from the memory of its device sends no block for minutes, but reports on /diagnostics.

    Parameters
    ----------
    node : Node
        The driver node, whose callbacks do not run meanwhile.
    discovery_time : float
        Time for which other publishers are looked for [s].

    Raises
    ------
    StageError
        If another publisher sends samples, or its node reports that it has its stage. A publisher without a sign of
        life counts as a driver that was killed.
    """
    deadline = time.monotonic() + discovery_time
    while node.count_publishers("samples") == 0:
        if time.monotonic() > deadline:
            return
        time.sleep(_INTERVAL)
    if _gives_sign_of_life(node):
        topic = node.resolve_topic_name("samples")
        raise StageError(f"{topic} is published by another driver; stop that one or take another namespace")
    node.get_logger().warning(
        "another publisher of samples exists but gives no sign of life; it is taken for a driver that was killed"
    )


def _gives_sign_of_life(node: Node) -> bool:
    """Whether a block of samples arrives, or a report of the node that publishes them."""
    signs: list[object] = []

    def report(array: DiagnosticArray) -> None:
        publishers = node.get_publishers_info_by_topic("samples")
        names = {status_name(f"{one.node_namespace.rstrip('/')}/{one.node_name}") for one in publishers}
        # a driver without a stage reports that, too; it may have the name of the one that was killed
        signs.extend(one for one in array.status if one.name in names and one.hardware_id)

    subscriptions = [
        node.create_subscription(PointCloud2, "samples", signs.append, SAMPLES),
        node.create_subscription(DiagnosticArray, DIAGNOSTICS, report, TOPICS[DIAGNOSTICS].quality),
    ]
    deadline = time.monotonic() + _SILENCE
    try:
        while not signs and time.monotonic() < deadline:
            time.sleep(_INTERVAL)
            for subscription in subscriptions:
                _take_all(subscription)
    finally:
        for subscription in subscriptions:
            node.destroy_subscription(subscription)
    return bool(signs)


def _take_all(subscription: Any) -> None:
    """Call the callback of a subscription with every message that has arrived."""
    callback: Callable[[Any], None] = subscription.callback
    while (taken := subscription.handle.take_message(subscription.msg_type, subscription.raw)) is not None:
        callback(taken[0])
