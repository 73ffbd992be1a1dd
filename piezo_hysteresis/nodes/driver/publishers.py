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

"""`DriverTopics`: converts deliveries and refusals of the driver to messages."""

from __future__ import annotations

from dataclasses import replace

from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.duration import Duration
from rclpy.lifecycle import LifecycleNode
from std_msgs.msg import Float64, String

from ...acquisition.drive import Event, EventKind, Phase
from ...acquisition.sample_block import Delivery, SampleBlock
from ...errors import counted
from ..messages.conversions import diagnostic, live, to_stamp
from ..messages.samples import SampleWriter
from ..runtime.sending import is_heard, send
from ..topics import advertise, advertise_lifecycle

_STATES = {EventKind.BEGAN: "playing", EventKind.DONE: "done", EventKind.STOPPED: "stopped"}
"""State in `command_status` for every event."""

_LONGEST_WAY = 0.5
"""Longest wait until the subscribers have received the last status [s]; one of them may be suspended."""


class DriverTopics:
    """Publishers of a driver.

    Parameters
    ----------
    node : rclpy.lifecycle.LifecycleNode
        The driver.
    stage : str
        Name of the stage.
    frame : str
        Frame in which the displacement is measured.
    sample_period : float
        Time between samples [s].
    live_rate : float
        Rate of the live scalars in stage time [Hz].
    """

    def __init__(self, node: LifecycleNode, stage: str, frame: str, sample_period: float, live_rate: float) -> None:
        self._stage, self.frame = stage, frame
        self._live_step = max(1, round(1 / (live_rate * sample_period)))
        self.restart()
        self._writer = SampleWriter()
        self._samples = advertise_lifecycle(node, "samples")
        self._voltage = advertise_lifecycle(node, "voltage")
        self._displacement = advertise_lifecycle(node, "displacement")
        self._live = advertise_lifecycle(node, "live")
        self._phase = advertise_lifecycle(node, "phase")
        self._status = advertise(node, "command_status")
        self._node = node

    @property
    def subscribers(self) -> int:
        """Matched subscribers of `samples`."""
        return int(self._samples.get_subscription_count())

    def restart(self) -> None:
        """Begin with a new acquisition, whose samples and phases are counted from 0 again."""
        self._next_live = 0
        self._first: dict[int, int] = {}

    def destroy(self) -> None:
        """Remove the publishers, after the last status has arrived."""
        self._status.wait_for_all_acked(Duration(seconds=_LONGEST_WAY))
        for publisher in (self._samples, self._voltage, self._displacement, self._live, self._phase):
            self._node.destroy_lifecycle_publisher(publisher)
        self._node.destroy_publisher(self._status)

    def deliver(self, delivery: Delivery) -> None:
        """Publish a block, after the phases that begin in it and before the ends of commands in it."""
        begun = [e for e in delivery.events if e.kind is EventKind.BEGAN]
        ended = [e for e in delivery.events if e.kind is not EventKind.BEGAN]
        for event in begun:
            send(self._phase, String(data=str(event.phase)))
            self._publish_event(event, delivery.first)
        if delivery.block.size and not send(
            self._samples, self._writer.write(replace(delivery.block, frame=self.frame))
        ):
            message = f"the middleware did not accept a block of {delivery.block.size} samples; the block is lost"
            self._node.get_logger().warning(message)
        for event in ended:
            self._publish_event(event, delivery.first)
        last = delivery.first + delivery.block.size - 1
        if delivery.block.size and last >= self._next_live:
            self._next_live = (last // self._live_step + 1) * self._live_step
            self._publish_live(delivery.block)

    def accepted(self, phase: Phase, size: int) -> None:
        """Report that a command will be played, with its number of samples."""
        self._publish_status(
            DiagnosticStatus.OK, phase.name, counted(size, "sample"), "accepted", phase.stamp, phase.number
        )

    def refused(self, name: str, stamp: int, reason: str) -> None:
        """Report that a command will not be played, with the reason."""
        self._publish_status(DiagnosticStatus.WARN, name, reason, "refused", stamp)

    def stopped(self, phase: Phase) -> None:
        """Report that the stage was asked to stop when no command was playing."""
        self._publish_status(DiagnosticStatus.WARN, phase.name, "stop", "stopped", phase.stamp, phase.number)

    def _publish_event(self, event: Event, first: int) -> None:
        phase = event.phase
        if not phase.commanded:
            return
        if event.kind is EventKind.BEGAN:
            self._first = {phase.number: first + event.offset}
        level = DiagnosticStatus.WARN if event.kind is EventKind.STOPPED else DiagnosticStatus.OK
        state = _STATES[event.kind]
        began = self._first.get(phase.number, first + event.offset)
        self._publish_status(level, phase.name, event.reason or state, state, phase.stamp, phase.number, began)

    def _publish_status(
        self,
        level: bytes,
        name: str,
        message: str,
        state: str,
        stamp: int,
        phase: int | str = "",
        first: int | str = "",
    ) -> None:
        at = to_stamp(stamp)
        values = {"state": state, "stamp": f"{at.sec}.{at.nanosec:09d}", "phase": phase}
        if isinstance(first, int):
            values["first_index"] = first % (1 << 32)
        send(self._status, diagnostic(level, name, message, self._stage, **values))

    def _publish_live(self, block: SampleBlock) -> None:
        voltage, displacement = float(block.voltage[-1]), float(block.displacement[-1])
        for publisher, value in ((self._voltage, voltage), (self._displacement, displacement)):
            if is_heard(publisher):
                send(publisher, Float64(data=value))
        if is_heard(self._live):
            stamp = to_stamp(block.stamp + round(float(block.time[-1]) * 1e9))
            send(self._live, live(stamp, self.frame, voltage=voltage, displacement=displacement))
