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

"""`DriverDiagnostics`: the driver's line on /diagnostics, once a second."""

from __future__ import annotations

import time

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.clock import Clock, ClockType

from ...acquisition.claim import Claim
from ...acquisition.safety.stop_latch import StopLatch
from ...acquisition.streaming import StreamingAcquisition
from ..messages.conversions import diagnostic, to_stamp, worst
from ..runtime.guarded_node import GuardedNode
from ..runtime.sending import send
from ..topics import DIAGNOSTICS, advertise

_LONGEST_CALL = 2.0
"""Duration of a call of a stage from which it is reported, in addition to two blocks [s]."""


def status_name(driver: str) -> str:
    """Name of the status of the driver with this full name."""
    return f"{driver.lstrip('/')}: stage"


class DriverDiagnostics:
    """Publishes the state, the rate and the losses once a second, and every change of state immediately.

    Parameters
    ----------
    node : GuardedNode
        The driver; its full name stands before every status.
    latch : StopLatch
        Latch of the driver, which shows whether it was stopped.

    Attributes
    ----------
    refused : int
        Number of refused commands.
    claim : Claim
        Claim on the stage.
    """

    def __init__(self, node: GuardedNode, latch: StopLatch) -> None:
        self._node, self._latch = node, latch
        self._name = status_name(node.get_fully_qualified_name())
        self._publisher = advertise(node, DIAGNOSTICS)
        self._state = (DiagnosticStatus.STALE, "not configured", "")
        self._acquisition: StreamingAcquisition | None = None
        self._target = 0.0
        self._seen = (time.monotonic(), 0, 0.0, 0.0, 0)
        self.refused = 0
        self.claim = Claim(0.0)
        node.create_timer(1.0, self.publish, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def state(self, level: bytes, message: str, stage: str = "") -> None:
        """Report a state of the driver from now on."""
        self._state = (level, message, stage)
        self.publish()

    def watch(self, acquisition: StreamingAcquisition | None, rate: float = 0.0) -> None:
        """Report the counters of an acquisition with its nominal rate [samples per s]; None ends this."""
        self._acquisition, self._target = acquisition, rate
        self._seen = (time.monotonic(), 0, 0.0, 0.0, 0)

    def publish(self) -> None:
        """Publish one array with one status."""
        level, message, stage = self._state
        values: dict[str, object] = {
            "refused_commands": self.refused,
            "faults": self._node.faults,
            "stopped": self._latch.is_set,
            "claimed_by": self.claim.owner,
        }
        notices = []
        if self._latch.is_set:
            notices.append("stopped; nothing moves until ~/release")
        if fault := self._node.recent_fault:
            notices.append(fault)
        acquisition = self._acquisition
        if acquisition is not None:
            tally, now = acquisition.tally, time.monotonic()
            then, samples, postponed, jumps, undated = self._seen
            covered = tally.samples + tally.never_measured
            self._seen = (now, covered, tally.postponed, tally.clock_jumps, tally.undated)
            duration = now - acquisition.keeper.begun
            if duration > _LONGEST_CALL + 2 * acquisition.block_size / self._target:
                notices.append(f"a call of the stage has not returned for {duration:.3g} s")
            if tally.postponed > postponed:
                notices.append(f"behind by {tally.postponed - postponed:.3g} s; the stamps moved")
            if tally.undated > undated:
                notices.append("the clock is after January 2038, later than a message can hold; the stamps stand still")
            if tally.clock_jumps > jumps:
                notices.append(f"the clock jumped by {tally.clock_jumps - jumps:.3g} s; the stamps moved with it")
            values |= {
                "rate": (covered - samples) / (now - then) if now > then else 0.0,
                "rate_expected": self._target,
                "samples": tally.samples,
                "blocks": tally.blocks,
                "never_measured": tally.never_measured,
                "latency_max": tally.latest,
                "postponed": tally.postponed,
                "clock_jumps": tally.clock_jumps,
                "clock_drift": tally.clock_drift,
                "voltage": acquisition.playback.voltage,
                "phase": str(acquisition.playback.phase),
            }
            tally.latest = 0.0
        if notices:
            level, message = worst(level, DiagnosticStatus.WARN), "; ".join((message, *notices))
        array = DiagnosticArray(status=[diagnostic(level, self._name, message, stage, **values)])
        array.header.stamp = to_stamp(self._node.get_clock().now().nanoseconds)
        send(self._publisher, array)
