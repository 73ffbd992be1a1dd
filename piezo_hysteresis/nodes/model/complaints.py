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

"""`Complaints`: what a model node could not use, in the log and on /diagnostics."""

from __future__ import annotations

from collections.abc import Iterator

from diagnostic_msgs.msg import DiagnosticStatus

from ..runtime.guarded_node import LOG_INTERVAL, GuardedNode

_LONGEST = 500
"""Largest number of characters of a reason that is repeated every second."""

_MOST = 8
"""Largest number of different problems that are reported together."""


class Complaints:
    """Problems with the samples since the last report, and the reason why a model was refused.

    Parameters
    ----------
    node : GuardedNode
        The model node.

    Attributes
    ----------
    count : int
        Number of problems and refusals so far.
    """

    def __init__(self, node: GuardedNode) -> None:
        self._node = node
        self._problems: list[str] = []
        self._refused = ""
        self.count = 0

    @property
    def has_problems(self) -> bool:
        """Whether samples could not be used since the last report."""
        return bool(self._problems)

    def findings(self) -> Iterator[tuple[bytes, str]]:
        """Level and message of what is to be reported now; also that a clock is missing."""
        clock = self._node.get_clock()
        if clock.ros_time_is_active and clock.now().nanoseconds == 0:
            yield DiagnosticStatus.WARN, "use_sim_time is true, and no message arrives on /clock"
        for message in filter(None, (self._refused, *self._problems)):
            yield DiagnosticStatus.ERROR, message

    def problem(self, message: str) -> None:
        """Report a problem in one line, now and until it has been `shown`."""
        self.count += 1
        if message[:_LONGEST] not in self._problems and len(self._problems) < _MOST:
            self._node.get_logger().warning(message, throttle_duration_sec=LOG_INTERVAL)
            self._problems.append(message[:_LONGEST])

    def refused(self, message: str) -> None:
        """Report why a model was refused, until another model is accepted."""
        self._node.get_logger().warning(message, throttle_duration_sec=LOG_INTERVAL)
        self._refused = message[:_LONGEST]
        self.count += 1

    def accepted(self) -> None:
        """A model was accepted."""
        self._refused = ""

    def shown(self) -> None:
        """The problems were reported."""
        self._problems = []
