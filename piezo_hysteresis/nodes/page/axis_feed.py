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

"""`AxisFeed`: the subscriptions and service clients of one axis, which keep its `AxisState`."""

from __future__ import annotations

import time
from concurrent.futures import Future as Reply

from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.task import Future
from std_msgs.msg import Float64, String
from std_srvs.srv import Trigger

from ...errors import PiezoError, printable
from ...report.live.axis_state import AxisState, Status
from ...report.live.controls import CONTROLS
from ...report.live.source import Answer
from ..identification.status import SUFFIX
from ..messages.cloud_stream import CloudReader
from ..messages.conversions import values_of
from ..messages.samples import PREDICTED_SAMPLES, SampleReader
from ..runtime.guarded_node import GuardedNode
from ..topics import TOPICS

PATIENCE = 5.0
"""Longest wait for the answer of a service [s]."""

_LONGEST_TEXT = 2000
"""Largest number of characters of a text from a message."""


class AxisFeed:
    """Follows one axis as long as the node runs.

    Parameters
    ----------
    node : GuardedNode
        The page node.
    axis : str
        Namespace of the axis, ``/`` for none.

    Attributes
    ----------
    state : AxisState
        The present state of the axis.
    """

    def __init__(self, node: GuardedNode, axis: str) -> None:
        self._node, self._prefix = node, axis.rstrip("/")
        self.state = AxisState(axis)
        self._samples, self._predicted = SampleReader(), CloudReader(PREDICTED_SAMPLES)
        for name, callback, raw in (
            ("samples", self._on_samples, True),
            ("predicted_samples", self._on_predicted, True),
            ("phase", self._on_phase, False),
            ("residual_rms", self._on_rms, False),
            ("change", self._on_change, False),
            ("status", self._on_status, False),
            ("model", self._on_model, False),
            ("recalibrations", self._on_recalibrations, False),
        ):
            topic = TOPICS[name]
            node.create_subscription(topic.type, f"{self._prefix}/{name}", callback, topic.deep, raw=raw)
        services = {control.service for control in CONTROLS} | {c.plan for c in CONTROLS if c.plan}
        self._clients = {name: node.create_client(Trigger, f"{self._prefix}/{name}") for name in services}
        self._waiting: list[tuple[float, Reply[Answer], str]] = []

    def call(self, service: str) -> Reply[Answer]:
        """Call a service; from any thread."""
        client = self._clients[service]
        if not client.service_is_ready():
            return unsent(f"no node serves {self._prefix}/{service}; is the node running?")
        reply: Reply[Answer] = Reply()
        self._waiting.append((time.monotonic(), reply, service))
        client.call_async(Trigger.Request()).add_done_callback(self._node.guarded(lambda done: _answer(reply, done)))
        return reply

    def expire(self) -> None:
        """End calls that were not answered in time."""
        for asked, reply, service in list(self._waiting):
            if reply.done():
                self._waiting.remove((asked, reply, service))
            elif time.monotonic() - asked > PATIENCE:
                _resolve(reply, Answer(False, f"{self._prefix}/{service} did not answer within {PATIENCE:g} s"))

    def report(self, status: DiagnosticStatus) -> bool:
        """Store a status of /diagnostics if it belongs to this axis; returns whether it does."""
        node = status.name.partition(":")[0]
        if f"/{node}".rpartition("/")[0] != self._prefix:
            return False
        self.state.report(to_status(status))
        return True

    def _on_samples(self, message: bytes) -> None:
        try:
            block = self._samples.read(message)
        except PiezoError as error:
            self._node.get_logger().warning(f"{self._prefix}/samples: {error}", throttle_duration_sec=1.0)
            return
        self.state.window.add(block.index, block.stamp * 1e-9 + block.time, block.voltage, block.displacement)
        self.state.heard = time.monotonic()

    def _on_predicted(self, message: bytes) -> None:
        try:
            columns = self._predicted.read(message)
        except PiezoError as error:
            self._node.get_logger().warning(f"{self._prefix}/predicted_samples: {error}", throttle_duration_sec=1.0)
            return
        self.state.window.add_prediction(columns.values["index"], columns.values["prediction"])

    def _on_phase(self, message: String) -> None:
        self.state.phase = printable(message.data[:_LONGEST_TEXT])

    def _on_rms(self, message: Float64) -> None:
        self.state.residual_rms = float(message.data)

    def _on_change(self, message: DiagnosticStatus) -> None:
        self.state.change = to_status(message)

    def _on_status(self, message: DiagnosticStatus) -> None:
        if message.name.endswith(SUFFIX):
            self.state.report_identification(to_status(message))

    def _on_recalibrations(self, message: String) -> None:
        try:
            self.state.report_recalibrations(message.data)
        except PiezoError as error:
            self._node.get_logger().warning(f"{self._prefix}: {error}", throttle_duration_sec=1.0)

    def _on_model(self, message: String) -> None:
        self.state.follow(message.data)


def to_status(message: DiagnosticStatus) -> Status:
    """A status without ROS types, shortened for display."""
    level = message.level
    return Status(
        printable(message.name[:_LONGEST_TEXT]),
        min(level[0] if isinstance(level, bytes) else int(level), 3),
        printable(message.message[:_LONGEST_TEXT]),
        {printable(k[:100]): printable(v[:_LONGEST_TEXT]) for k, v in values_of(message).items()},
    )


def unsent(reason: str) -> Reply[Answer]:
    """The reply to a call that was not sent."""
    reply: Reply[Answer] = Reply()
    reply.set_result(Answer(False, reason))
    return reply


def _answer(reply: Reply[Answer], done: Future) -> None:
    response = done.result()
    _resolve(reply, Answer(bool(response.success), printable(response.message[:_LONGEST_TEXT])))


def _resolve(reply: Reply[Answer], answer: Answer) -> None:
    if not reply.done():
        reply.set_result(answer)
