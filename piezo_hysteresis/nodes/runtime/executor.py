"""`make_executor` and `spin_until`: what serves the callbacks of a node, one after the other, in one thread."""

from __future__ import annotations

from rclpy.executors import Executor, SingleThreadedExecutor
from rclpy.task import Future

from .guarded_node import GuardedNode

try:
    from rclpy.experimental.events_executor import EventsExecutor
except ImportError:  # before Kilted there is none
    EventsExecutor = SingleThreadedExecutor

_LONGEST_SPIN = 60.0
"""The events executor of some builds waits for ever, and for nothing, where it is given no time [s]."""


def make_executor() -> Executor:
    """The executor of callbacks as they come, where the distribution has it.

    The other one puts together the set of all that may happen anew for every message, which takes longer than most of
    the callbacks.
    """
    return EventsExecutor()


def spin_until(executor: Executor, done: Future, node: GuardedNode) -> None:
    """Serve the callbacks of a node until `done`, which may be set from any thread.

    The node reports every exception, also one of the executor itself, and goes on serving.
    """
    while not done.done():
        try:
            executor.spin_until_future_complete(done, timeout_sec=_LONGEST_SPIN)
        except Exception as error:
            if not node.context.ok():
                raise
            node.fault(error)
