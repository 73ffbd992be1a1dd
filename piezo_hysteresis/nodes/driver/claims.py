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

"""`DriverClaims`: the topic `claim` of the driver, and `claimed_by`, which shows who holds it."""

from __future__ import annotations

import time
from collections.abc import Callable

from diagnostic_msgs.msg import KeyValue
from rclpy.clock import Clock, ClockType
from std_msgs.msg import String

from ...acquisition.claim import Claim
from ...acquisition.streaming import StreamingAcquisition
from ...errors import PiezoError, StageError
from ..runtime.guarded_node import GuardedNode
from ..runtime.sending import send
from ..topics import advertise, subscribe

_LOOK = 0.25
"""Interval at which it is checked whether the owner renews its claim [s]."""


class DriverClaims:
    """Grants, releases and ends claims. When a claim ends, the stage goes to the safe voltage.

    Parameters
    ----------
    node : GuardedNode
        The driver.
    claim : Claim
        Of its stage.
    streaming : callable
        Returns the running acquisition; raises StageError where there is none.
    refuse : callable
        Takes the name of the refused request, a stamp, and the reason.
    """

    def __init__(
        self,
        node: GuardedNode,
        claim: Claim,
        streaming: Callable[[], StreamingAcquisition],
        refuse: Callable[[str, int, PiezoError], None],
    ) -> None:
        self._node, self._claim, self._streaming, self._refuse = node, claim, streaming, refuse
        self._publisher, self._has_stage = advertise(node, "claimed_by"), False
        subscribe(node, "claim", self._on_claim)
        node.create_timer(_LOOK, self._look, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def attach(self) -> None:
        """Grant claims from now on. A driver without a stage says nothing: another one may have it."""
        self._has_stage = True
        self._show()

    def detach(self) -> None:
        """Grant no more claims."""
        self._has_stage = False

    def _on_claim(self, message: KeyValue) -> None:
        try:
            if message.value == "claim":
                if self._has_stage and self._claim.take(message.key, time.monotonic()):
                    self._node.get_logger().info(f"claimed by {self._claim.owner}")
                    self._show()
            elif message.value == "renew":
                self._claim.renew(message.key, time.monotonic())  # the end of a claim is published on 'claimed_by'
            elif message.value == "release":
                if self._claim.release(message.key):
                    self._end(f"{message.key} has released the stage")
            else:
                raise StageError(f"claim: got {message.value[:80]!r}, expected 'claim', 'renew' or 'release'")
        except StageError as error:
            self._refuse("claim", 0, error)

    def _look(self) -> None:
        """End an expired claim. A waveform of its owner is played to its end, which lies at the safe voltage."""
        owner = self._claim.owner
        if not self._claim.has_expired(time.monotonic()) or self._is_playing():
            return
        self._claim.release(owner)
        self._end(f"{owner} did not renew its claim; the claim has ended")

    def _is_playing(self) -> bool:
        try:
            return self._streaming().playback.is_playing
        except StageError:
            return False

    def _end(self, reason: str) -> None:
        try:
            streaming = self._streaming()
            if not streaming.playback.is_safe:
                streaming.cancel()
        except StageError:
            pass  # not active: the stage is at its safe voltage
        self._node.get_logger().info(reason)
        self._show()

    def _show(self) -> None:
        send(self._publisher, String(data=self._claim.owner))
