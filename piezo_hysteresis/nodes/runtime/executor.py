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
