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

"""`GuardedNode`: a node that keeps running after an exception in a callback, including callbacks of rclpy."""

from __future__ import annotations

import time
import traceback
from collections.abc import Callable
from functools import wraps
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rcl_interfaces.msg import SetParametersResult
from rclpy.node import Node
from rclpy.parameter import Parameter

from ...acquisition.stage_lock import StageLock
from ...errors import reason_of
from ..messages.conversions import diagnostic, values_of, worst

_REMEMBERED = 10.0
"""Time for which a fault is shown on /diagnostics [s]."""

LOG_INTERVAL = 0.1
"""Shortest time between two lines of one kind in the log [s]: a stream of faults or messages must not fill the disk."""


def _refuse_another_clock(parameters: list[Parameter]) -> SetParametersResult:
    """Refuse a change of the clock at run time, because /clock could then stop the node."""
    if any(parameter.name == "use_sim_time" for parameter in parameters):
        return SetParametersResult(successful=False, reason="use_sim_time is read at start; give it then")
    return SetParametersResult(successful=True)


class GuardedNode(Node):
    """Passes exceptions of callbacks to `fault` and continues. Its clock cannot be changed after the start.

    Subscriptions, services and timers are guarded when they are made, also those that rclpy makes itself (``/clock``,
    parameter services). A service that fails still answers; where its response has such fields, ``success`` is false
    and the reason is given.

    Attributes
    ----------
    faults : int
        Number of exceptions of callbacks so far.
    """

    faults = 0
    _name_lock: StageLock | None = None
    _newest_fault = ""
    _fault_time = 0.0

    def __init__(self, *arguments: Any, **named: Any) -> None:
        super().__init__(*arguments, **named)
        self.add_on_set_parameters_callback(_refuse_another_clock)

    def hold_name(self) -> None:
        """Hold the name of this node on this computer until it is destroyed or its process ends.

        Of two nodes of one name each carries out the same request, and each sends its own answer.

        Raises
        ------
        StageError
            If a node of another process holds the name.
        """
        where = f"domain {self.context.get_domain_id()}"
        self._name_lock = StageLock([f"the name {self.get_fully_qualified_name()} in {where}"])

    def destroy_node(self) -> None:
        """Destroy the node, and release its name."""
        super().destroy_node()
        if self._name_lock is not None:
            self._name_lock.release()

    @property
    def recent_fault(self) -> str:
        """The newest fault of the last seconds in one line; empty where there was none."""
        return self._newest_fault if time.monotonic() - self._fault_time < _REMEMBERED else ""

    def fault(self, error: Exception) -> None:
        """Count an exception of a callback, and report it with the place where it was raised."""
        places = traceback.extract_tb(error.__traceback__)
        place = f" ({places[-1].filename}:{places[-1].lineno})" if places else ""
        self.faults += 1
        self._newest_fault, self._fault_time = reason_of(error), time.monotonic()
        self.get_logger().error(f"{self._newest_fault}{place}", throttle_duration_sec=LOG_INTERVAL)

    def reported(self, status: DiagnosticStatus) -> DiagnosticArray:
        """A stamped status for /diagnostics with the faults so far. A recent fault raises its level."""
        fault = self.recent_fault
        merged = diagnostic(
            worst(status.level, DiagnosticStatus.WARN) if fault else status.level,
            status.name,
            f"{status.message}; {fault}" if fault else status.message,
            status.hardware_id,
            **values_of(status),
            faults=self.faults,
        )
        array = DiagnosticArray(status=[merged])
        array.header.stamp = self.get_clock().now().to_msg()
        return array

    def guarded(self, callback: Callable[..., Any]) -> Callable[..., Any]:
        """Wrap `callback` so that its exceptions go to `fault`; for tasks and for the callbacks of futures.

        The events executor of some builds crashes where a task raises.
        """

        @wraps(callback)
        def call(*arguments: Any) -> Any:
            try:
                return callback(*arguments)
            except Exception as error:
                self.fault(error)
                return None

        return call

    def create_subscription(self, msg_type: Any, topic: str, callback: Any, *arguments: Any, **named: Any) -> Any:
        """As `rclpy.node.Node.create_subscription`, guarded."""
        return super().create_subscription(msg_type, topic, self.guarded(callback), *arguments, **named)

    def create_timer(self, timer_period_sec: float, callback: Any, *arguments: Any, **named: Any) -> Any:
        """As `rclpy.node.Node.create_timer`, guarded."""
        return super().create_timer(timer_period_sec, self.guarded(callback), *arguments, **named)

    def create_service(self, srv_type: Any, srv_name: str, callback: Any, *arguments: Any, **named: Any) -> Any:
        """As `rclpy.node.Node.create_service`, guarded."""

        @wraps(callback)
        def answer(request: Any, response: Any) -> Any:
            try:
                return callback(request, response)
            except Exception as error:
                self.fault(error)
                refused = srv_type.Response()
                if hasattr(refused, "success") and hasattr(refused, "message"):
                    refused.success, refused.message = False, reason_of(error)
                return refused

        return super().create_service(srv_type, srv_name, answer, *arguments, **named)
