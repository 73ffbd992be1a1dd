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

"""`make_executor` and `spin_until`: run the callbacks of a node one after the other in one thread."""

from __future__ import annotations

from rclpy.executors import Executor, SingleThreadedExecutor
from rclpy.task import Future

from .guarded_node import GuardedNode

try:
    from rclpy.experimental.events_executor import EventsExecutor
except ImportError:  # not available before Kilted
    EventsExecutor = SingleThreadedExecutor

_LONGEST_SPIN = 60.0
"""Longest wait of one spin [s]. Without a limit the events executor of some builds waits for ever."""


def make_executor() -> Executor:
    """The events executor, where the distribution has it.

    The other executor builds the set of all possible events again for every message, which takes longer than most
    callbacks.
    """
    return EventsExecutor()


def spin_until(executor: Executor, done: Future, node: GuardedNode) -> None:
    """Serve the callbacks of a node until `done`, which may be set from any thread.

    The node reports every exception, also those of the executor itself, and continues.
    """
    while not done.done():
        try:
            executor.spin_until_future_complete(done, timeout_sec=_LONGEST_SPIN)
        except Exception as error:
            if not node.context.ok():
                raise
            node.fault(error)
