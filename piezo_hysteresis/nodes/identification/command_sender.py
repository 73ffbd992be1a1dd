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

"""`CommandSender`: packs waveforms and publishes them to the driver in its own thread."""

from __future__ import annotations

import threading
from collections.abc import Callable

from builtin_interfaces.msg import Time
from rclpy.duration import Duration
from rclpy.node import Node

from ...errors import reason_of
from ...identification.protocol.phases import ProtocolPhase
from ..messages.conversions import command_to_cloud
from ..runtime.sending import is_taken_by, send
from ..topics import advertise

_LONGEST_WAY = 2.0
"""Longest wait for a waveform that is being sent when the phase is cancelled [s]."""


class CommandSender:
    """Publishes on `command` in its own thread, because minutes of drive (80 MB) take seconds on a busy computer.

    Parameters
    ----------
    node : rclpy.node.Node
        The identification node.
    """

    def __init__(self, node: Node) -> None:
        self._node = node
        self._publisher = advertise(node, "command")
        self._thread: threading.Thread | None = None
        self._called_off = threading.Event()

    def reaches(self, driver: str) -> bool:
        """Whether the node `driver` of this namespace subscribes to the command; a recorder alone plays nothing."""
        return is_taken_by(driver, self._node, self._publisher)

    def send(
        self, phase: ProtocolPhase, owner: str, leaving: Callable[[Time], None], lost: Callable[[str], None]
    ) -> None:
        """Send a phase. It is stamped when it is published, so that its age is the transport time.

        Parameters
        ----------
        phase : ProtocolPhase
        owner : str
            Holder of the claim on the stage; empty where nobody claims it.
        leaving : callable
            Called with the stamp before the message is published, in the thread.
        lost : callable
            Called with the reason where the message did not leave, in the thread.
        """
        self._join()  # the result of the phase before is known
        self._called_off.clear()
        self._thread = threading.Thread(
            target=self._send, args=(phase, owner, leaving, lost), name="command", daemon=True
        )
        self._thread.start()

    def call_off(self, has_arrived: bool) -> None:
        """Wait until no waveform is being sent, because one that arrives after a stop would be played.

        Parameters
        ----------
        has_arrived : bool
            Whether the driver has answered the last phase. The middleware confirms it seconds later; a dead driver
            confirms nothing.
        """
        self._called_off.set()
        if self._join() and not has_arrived:
            self._publisher.wait_for_all_acked(Duration(seconds=_LONGEST_WAY))

    def _join(self) -> bool:
        """Wait until the thread has ended; returns False where there was none."""
        thread, self._thread = self._thread, None
        if thread is not None:
            thread.join()
        return thread is not None

    def _send(
        self, phase: ProtocolPhase, owner: str, leaving: Callable[[Time], None], lost: Callable[[str], None]
    ) -> None:
        try:
            cloud = command_to_cloud(
                phase.voltage, phase.sample_period, f"{phase.name}@{owner}" if owner else phase.name
            )
            if self._called_off.is_set():
                return
            cloud.header.stamp = self._node.get_clock().now().to_msg()
            leaving(cloud.header.stamp)
            if not send(self._publisher, cloud):
                lost("the middleware did not accept the waveform")
        except Exception as error:
            lost(reason_of(error))
