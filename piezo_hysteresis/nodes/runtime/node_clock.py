"""`now`: the time on a node's clock."""

from __future__ import annotations

import time

from rclpy.clock import ROSClock
from rclpy.node import Node


def now(node: Node) -> int:
    """Time on the clock of a node [ns].

    rclpy makes several objects to show it: that is left to simulated time.
    """
    clock = node.get_clock()
    if isinstance(clock, ROSClock) and not clock.ros_time_is_active:
        return time.time_ns()
    return int(clock.now().nanoseconds)
