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

"""`IdentificationStatus`: progress of the identification, on `status` at every change and on /diagnostics."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.clock import Clock, ClockType

from ..messages.conversions import diagnostic, values_of
from ..runtime.guarded_node import GuardedNode
from ..runtime.sending import send
from ..topics import DIAGNOSTICS, advertise

if TYPE_CHECKING:
    from .protocol_runner import Progress

SUFFIX = ": identification"
"""End of the name of its statuses; other nodes publish on `status`, too."""

ENDED = ("done", "failed", "aborted")
"""States in which a job has ended."""


class IdentificationStatus:
    """Publishes state, phase, percent and reason.

    Parameters
    ----------
    node : GuardedNode
        The identification node; its full name stands before every status.

    Attributes
    ----------
    experiment : str
        Path of the recording that is being made or fitted.
    owner : str
        Name with which the stage is claimed while it is driven.
    goal : str
        Identifier of the present or last job; the answer of the service that began the job contains it.
    likely : str
        The likeliest explanations of a live diagnosis with their probabilities.
    listener : callable
        Called with every new status.
    """

    def __init__(self, node: GuardedNode) -> None:
        self._node = node
        self._name = f"{node.get_fully_qualified_name().lstrip('/')}{SUFFIX}"
        self._publisher = advertise(node, "status")
        self._diagnostics = advertise(node, DIAGNOSTICS)
        self.experiment = self.owner = self.goal = self.likely = ""
        self.listener: Callable[[DiagnosticStatus], None] = lambda status: None
        self._shown = DiagnosticStatus()
        self._logged = ("", "")
        self._show(DiagnosticStatus.OK, "idle", "nothing is under way")
        node.create_timer(1.0, self._repeat, clock=Clock(clock_type=ClockType.STEADY_TIME))

    @property
    def state(self) -> str:
        """The last published state."""
        return values_of(self._shown).get("state", "")

    def progress(self, progress: Progress) -> None:
        """Report the progress of the running job. New states and phases are also logged."""
        if (stage := (progress.state, progress.phase)) != self._logged:
            self._logged = stage
            self._node.get_logger().info(f"{progress.state}: {progress.phase or progress.reason}")
        self._show(DiagnosticStatus.OK, progress.state, progress.reason, progress.phase, progress.fraction)

    def set_likely(self, likely: str) -> None:
        """Add the probabilities of the explanations to all further statuses."""
        self._node.get_logger().info(f"likely: {likely}")
        self.likely = likely

    def done(self, verdict: str, conclusion: str) -> None:
        """Report the result; `conclusion` is the stable word of a diagnosis, or empty."""
        self._node.get_logger().info(f"done: {verdict}")
        self._show(DiagnosticStatus.OK, "done", verdict, fraction=1.0, conclusion=conclusion)

    def failed(self, reason: str) -> None:
        """Report an error."""
        self._node.get_logger().error(reason)
        self._show(DiagnosticStatus.ERROR, "failed", reason)

    def aborted(self, reason: str) -> None:
        """Report that the job was aborted."""
        self._node.get_logger().warning(f"aborted: {reason}")
        self._show(DiagnosticStatus.WARN, "aborted", reason)

    def _show(
        self, level: bytes, state: str, reason: str, phase: str = "", fraction: float = 0.0, conclusion: str = ""
    ) -> None:
        status = diagnostic(
            level,
            self._name,
            reason,
            state=state,
            phase=phase,
            percent=round(100 * fraction),
            experiment=self.experiment,
            owner=self.owner,
            goal=self.goal,
            likely=self.likely,
            conclusion=conclusion,
        )
        if status != self._shown:
            self._shown = status
            send(self._publisher, status)
            self.listener(status)

    def _repeat(self) -> None:
        send(self._diagnostics, self._node.reported(self._shown))
