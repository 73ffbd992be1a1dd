"""`DriverCommands`: what others ask of the driver: `command`, `set_voltage`, `~/stop`."""

from __future__ import annotations

from rclpy.node import Node
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import Float64
from std_srvs.srv import Trigger

from ...acquisition.session import DriverSession
from ...errors import PiezoError, StageError, printable
from ..messages.conversions import from_stamp, waveform_from_cloud
from ..messages.phase_text import phase_name
from ..runtime.node_clock import now
from ..topics import subscribe
from .diagnostics import DriverDiagnostics
from .publishers import DriverTopics

_LONGEST_NAME = 64
"""Characters of a phase name at most."""

_LOG_INTERVAL = 0.1
"""Shortest time between two lines of one kind in the log [s]: a flood of commands fills no disk."""


class DriverCommands:
    """Passes commands to the attached stage, or refuses them whole; every refusal is told with its reason.

    Parameters
    ----------
    node : rclpy.node.Node
        The driver.
    diagnostics : DriverDiagnostics
        Counts the refusals.
    """

    def __init__(self, node: Node, diagnostics: DriverDiagnostics) -> None:
        self._node, self._diagnostics = node, diagnostics
        self._attached: tuple[DriverSession, DriverTopics] | None = None
        subscribe(node, "command", self._on_command)
        subscribe(node, "set_voltage", self._on_set_voltage)
        node.create_service(Trigger, "~/stop", self._on_stop)

    def attach(self, session: DriverSession, topics: DriverTopics) -> None:
        """Pass commands to this stage from now on."""
        self._attached = (session, topics)

    def detach(self) -> None:
        """Refuse every command from now on."""
        self._attached = None

    def _stage(self) -> tuple[DriverSession, DriverTopics]:
        if self._attached is None:
            raise StageError("the driver is not configured; configure and activate it")
        return self._attached

    def _on_command(self, cloud: PointCloud2) -> None:
        name, stamp = printable(cloud.header.frame_id[:_LONGEST_NAME]), 0
        try:
            stamp = from_stamp(cloud.header.stamp)
            session, topics = self._stage()
            name = phase_name(cloud.header.frame_id)
            voltage = waveform_from_cloud(cloud, session.sample_period)
            waveform = session.check.waveform(voltage, stamp, now(self._node))
            phase = session.streaming.play(waveform, name, stamp, session.check.first_step, topics.accepted)
        except PiezoError as error:
            self._refuse(name, stamp, error)
        else:
            told = f"playing {phase}: {waveform.size * session.sample_period:g} s"
            self._node.get_logger().info(told, throttle_duration_sec=_LOG_INTERVAL)

    def _on_set_voltage(self, message: Float64) -> None:
        try:
            session, _ = self._stage()
            session.streaming.ramp_to(session.check.set_point(message.data))
        except PiezoError as error:
            self._refuse("set_voltage", 0, error)

    def _on_stop(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        response.success = True
        try:
            session, topics = self._stage()
            phase, was_playing = session.streaming.stop()
        except StageError as error:
            response.message = f"{error}; it was left at its safe voltage"
            return response
        if not was_playing:
            topics.stopped(phase)
        response.message = f"on the way to the safe voltage, {session.limits.safe_voltage:g} V"
        self._node.get_logger().info(f"stopped {phase}: {response.message}", throttle_duration_sec=_LOG_INTERVAL)
        return response

    def _refuse(self, name: str, stamp: int, reason: PiezoError) -> None:
        self._diagnostics.refused += 1
        self._node.get_logger().warning(f"refused '{name}': {reason}", throttle_duration_sec=_LOG_INTERVAL)
        if self._attached is not None:
            self._attached[1].refused(name, stamp, str(reason))
