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

"""`send`: publishes a message. If the middleware is out of time, the message is lost and the node continues.

`is_heard` shows whether a message is worth making, `is_taken_by` whether a certain node would receive it.
"""

from __future__ import annotations

from typing import Any

from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.publisher import Publisher

ATTEMPTS = 5
"""Number of attempts. Fast DDS drops a message when it has waited 0.1 s for its own lock, which happens on a busy
computer."""


def send(publisher: Publisher, message: Any) -> bool:
    """Publish a message; returns False where the middleware did not accept it, so that it is lost."""
    for _ in range(ATTEMPTS):
        try:
            publisher.publish(message)
        except rclpy_implementation.RCLError:
            continue
        return True
    return False


def is_heard(publisher: Publisher) -> bool:
    """Whether a publisher has a subscriber."""
    return bool(publisher.get_subscription_count())


def is_taken_by(taker: str, node: Node, publisher: Publisher) -> bool:
    """Whether the node `taker` in the namespace of `node` subscribes to the topic of its publisher."""
    takers = node.get_subscriptions_info_by_topic(publisher.topic_name)
    return (taker, node.get_namespace()) in {(one.node_name, one.node_namespace) for one in takers}
