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

"""`CompensationStatus`: what the compensation node does, on `status` at every change and on /diagnostics."""

from __future__ import annotations

from collections.abc import Callable

from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.clock import Clock, ClockType

from ...errors import printable
from ..messages.conversions import diagnostic
from ..runtime.guarded_node import GuardedNode
from ..runtime.sending import send
from ..topics import DIAGNOSTICS, advertise

ENDED = ("done", "planned", "refused", "failed", "stopped")
"""States in which the job of a path has ended."""


class CompensationStatus:
    """Publishes state and reason, and the errors expected and reached.

    Parameters
    ----------
    node : GuardedNode
        The compensation node; its full name stands before every status.

    Attributes
    ----------
    listener : callable
        Called with every new status.
    """

    def __init__(self, node: GuardedNode) -> None:
        self._node = node
        self._name = f"{node.get_fully_qualified_name().lstrip('/')}: compensation"
        self._publisher = advertise(node, "status")
        self._diagnostics = advertise(node, DIAGNOSTICS)
        self.listener: Callable[[DiagnosticStatus], None] = lambda status: None
        self.refused = 0
        self._shown = DiagnosticStatus()
        self.show("idle", "nothing was asked for since the start")
        node.create_timer(1.0, self._repeat, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def show(
        self,
        state: str,
        reason: str,
        phase: str = "",
        level: bytes = DiagnosticStatus.OK,
        first_index: int | None = None,
        **errors: float,
    ) -> None:
        """Publish a state; `first_index` is the first sample of the path in `samples`, errors are in metres."""
        texts = {name: f"{error:.6g}" for name, error in errors.items()}
        if first_index is not None:
            texts["first_index"] = str(first_index)
        status = diagnostic(level, self._name, reason, "", state=state, phase=phase, refused=self.refused, **texts)
        if status != self._shown:
            self._shown = status
            send(self._publisher, status)
            self.listener(status)

    def refuse(self, phase: str, reason: str) -> None:
        """Report that nothing moves, with the reason."""
        self.refused, phase = self.refused + 1, printable(phase)
        self._node.get_logger().warning(f"refused '{phase}': {reason}", throttle_duration_sec=0.1)
        self.show("refused", reason, phase, DiagnosticStatus.WARN)

    def lost(self, reason: str) -> None:
        """Report why a displacement is not held any more."""
        message = f"nothing is held any more: {reason}"
        self._node.get_logger().warning(message)
        self.show("stopped", message, "set_displacement", DiagnosticStatus.WARN)

    def failed(self, phase: str, reason: str) -> None:
        """Report an error after the stage has moved."""
        self._node.get_logger().error(f"'{phase}': {reason}")
        self.show("failed", reason, phase, DiagnosticStatus.ERROR)

    def _repeat(self) -> None:
        send(self._diagnostics, self._node.reported(self._shown))
