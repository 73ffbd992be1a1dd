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

"""`DriverCommands`: handles the requests `command`, `set_voltage`, `~/stop`, `~/cancel` and `~/release`."""

from __future__ import annotations

from collections.abc import Callable

from sensor_msgs.msg import PointCloud2
from std_msgs.msg import Float64

from ...acquisition.safety.stop_latch import StopLatch
from ...acquisition.session import DriverSession
from ...errors import PiezoError, StageError, printable
from ..messages.conversions import from_stamp, phase_text_of, waveform_from_cloud
from ..messages.phase_text import phase_and_owner
from ..runtime.guarded_node import LOG_INTERVAL, GuardedNode
from ..runtime.node_clock import now
from ..topics import subscribe
from .claims import DriverClaims
from .diagnostics import DriverDiagnostics
from .publishers import DriverTopics
from .stop_services import StopServices

_LONGEST_NAME = 64
"""Largest number of characters of a phase name."""

_SET_POINT_INTERVAL = 1.0
"""Shortest time between two lines about set-points [s], which a program may send continuously."""


class DriverCommands:
    """Passes a command to the attached stage or refuses it completely, and reports the reason of a refusal.

    Parameters
    ----------
    node : GuardedNode
        The driver.
    diagnostics : DriverDiagnostics
        Counts the refusals.
    latch : StopLatch
        Latch of the driver.
    publish_latch : callable
        Called in the thread of the stop when the driver is stopped or released.
    """

    def __init__(
        self, node: GuardedNode, diagnostics: DriverDiagnostics, latch: StopLatch, publish_latch: Callable[[], None]
    ) -> None:
        self._node, self._diagnostics, self._latch, self._publish_latch = node, diagnostics, latch, publish_latch
        self._attached: tuple[DriverSession, DriverTopics] | None = None
        self._claim = diagnostics.claim
        self._claims = DriverClaims(node, self._claim, lambda: self._stage()[0].streaming, self._refuse)
        subscribe(node, "command", self._on_command)
        subscribe(node, "set_voltage", self._on_set_voltage)
        self._services = StopServices(node, stop=self._stop, cancel=self._cancel, release=self._release)

    def attach(self, session: DriverSession, topics: DriverTopics) -> None:
        """Pass commands to this stage from now on."""
        self._attached = (session, topics)
        self._claim.timeout = session.settings.claim_timeout
        self._claims.attach()

    def detach(self) -> None:
        """Refuse every command from now on."""
        self._attached = None
        self._claims.detach()

    def end(self) -> None:
        """End the services for stopping."""
        self._services.end()

    def _stage(self) -> tuple[DriverSession, DriverTopics]:
        if self._attached is None:
            raise StageError("the driver is not configured and does not know its stage; configure and activate it")
        return self._attached

    def _on_command(self, cloud: PointCloud2) -> None:
        text = phase_text_of(cloud, self._attached[1].frame if self._attached else "")
        name, stamp = printable(text[:_LONGEST_NAME]), 0
        try:
            name, owner = phase_and_owner(text)
            stamp = from_stamp(cloud.header.stamp)
            session, topics = self._stage()
            self._latch.require_released(name)
            self._claim.require(owner, name)
            voltage = waveform_from_cloud(cloud, session.sample_period)
            waveform = session.check.waveform(voltage, stamp, now(self._node))
            phase = session.streaming.play(waveform, name, stamp, session.check.first_step, topics.accepted)
        except PiezoError as error:
            self._refuse(name, stamp, error)
        else:
            message = f"playing {phase}: {waveform.size * session.sample_period:g} s"
            self._node.get_logger().info(message, throttle_duration_sec=LOG_INTERVAL)

    def _on_set_voltage(self, message: Float64) -> None:
        try:
            session, _ = self._stage()
            self._claim.require("", "set_voltage")
            session.streaming.ramp_to(session.check.set_point(message.data))
        except PiezoError as error:
            self._refuse("set_voltage", 0, error)

    def _stop(self) -> str:
        """Go to the safe voltage, and forbid all motion until the stop is released."""
        self._latch.set()
        self._publish_latch()
        try:
            message = self._go_to_safety(latch=True)
        except StageError as error:
            message = str(error)
        return f"{message}; nothing moves until ~/release"

    def _cancel(self) -> str:
        """Go to the safe voltage. The next command is accepted when the stage has reached it."""
        return self._go_to_safety(latch=False)

    def _release(self) -> str:
        was_set = self._latch.release()
        self._publish_latch()
        return "the driver accepts commands again" if was_set else "the driver was not stopped"

    def _go_to_safety(self, latch: bool) -> str:
        session, topics = self._stage()
        streaming = session.streaming
        phase, was_playing = streaming.stop() if latch else streaming.cancel()
        if not was_playing:
            topics.stopped(phase)
        message = f"on the way to the safe voltage, {session.limits.safe_voltage:g} V"
        self._node.get_logger().info(f"stopped {phase}: {message}", throttle_duration_sec=LOG_INTERVAL)
        return message

    def _refuse(self, name: str, stamp: int, reason: PiezoError) -> None:
        self._diagnostics.refused += 1
        message = f"refused '{name}': {reason}"
        if name == "set_voltage":  # rclpy limits the rate separately for every line of code
            self._node.get_logger().warning(message, throttle_duration_sec=_SET_POINT_INTERVAL)
        else:
            self._node.get_logger().warning(message, throttle_duration_sec=LOG_INTERVAL)
        if self._attached is not None:
            self._attached[1].refused(name, stamp, str(reason))
