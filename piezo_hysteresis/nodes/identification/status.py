"""`IdentificationStatus`: where the identification stands, on `status` at every change and on /diagnostics."""

from __future__ import annotations

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.clock import Clock, ClockType
from rclpy.node import Node

from ..messages.conversions import diagnostic
from ..runtime.sending import send
from ..topics import DIAGNOSTICS, advertise
from .protocol_runner import Progress


class IdentificationStatus:
    """Publishes state, phase, percent and reason.

    Parameters
    ----------
    node : rclpy.node.Node
        The identification node; its full name stands before every status.

    Attributes
    ----------
    experiment : str
        Path of the recording that is made or fitted.
    """

    def __init__(self, node: Node) -> None:
        self._node = node
        self._name = f"{node.get_fully_qualified_name().lstrip('/')}: identification"
        self._publisher = advertise(node, "status")
        self._diagnostics = advertise(node, DIAGNOSTICS)
        self.experiment = ""
        self._shown: DiagnosticStatus | None = None
        self._show(DiagnosticStatus.OK, "idle", "nothing is under way")
        node.create_timer(1.0, self._repeat, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def progress(self, progress: Progress) -> None:
        """Tell where the job under way stands."""
        self._show(DiagnosticStatus.OK, progress.state, progress.reason, progress.phase, progress.fraction)

    def done(self, verdict: str) -> None:
        """Tell the result."""
        self._node.get_logger().info(f"done: {verdict}")
        self._show(DiagnosticStatus.OK, "done", verdict, fraction=1.0)

    def failed(self, reason: str) -> None:
        """Tell what went wrong."""
        self._node.get_logger().error(reason)
        self._show(DiagnosticStatus.ERROR, "failed", reason)

    def aborted(self, reason: str) -> None:
        """Tell that the job was given up."""
        self._node.get_logger().warning(f"aborted: {reason}")
        self._show(DiagnosticStatus.WARN, "aborted", reason)

    def _show(self, level: bytes, state: str, reason: str, phase: str = "", fraction: float = 0.0) -> None:
        status = diagnostic(
            level,
            self._name,
            reason,
            state=state,
            phase=phase,
            percent=round(100 * fraction),
            experiment=self.experiment,
        )
        if status != self._shown:
            self._shown = status
            send(self._publisher, status)

    def _repeat(self) -> None:
        array = DiagnosticArray(status=[self._shown])
        array.header.stamp = self._node.get_clock().now().to_msg()
        send(self._diagnostics, array)
