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

"""`now`: the time on a node's clock."""

from __future__ import annotations

import time

from rclpy.clock import ROSClock
from rclpy.node import Node


def now(node: Node) -> int:
    """Time on the clock of a node [ns].

    rclpy makes several objects for this, which is only done for simulated time.
    """
    clock = node.get_clock()
    if isinstance(clock, ROSClock) and not clock.ros_time_is_active:
        return time.time_ns()
    return int(clock.now().nanoseconds)
