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

"""`DriverClient`: the driver as seen from the identification node.

It holds the limits, the voltage, and the state of commands.
"""

from __future__ import annotations

import math
import os
import time

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticStatus, KeyValue
from rclpy.clock import Clock, ClockType
from rclpy.parameter import parameter_value_to_python
from rclpy.parameter_client import AsyncParameterClient
from rclpy.task import Future
from std_msgs.msg import Float64, String
from std_srvs.srv import Trigger

from ...errors import PiezoError, printable
from ...identification.protocol.drive_limits import DriveLimits
from ...identification.protocol.phases import ProtocolPhase
from ..messages.conversions import values_of
from ..runtime.guarded_node import GuardedNode
from ..runtime.sending import send
from ..topics import advertise, subscribe
from .command_sender import CommandSender

_NAMES = ("sample_period", "voltage_min", "voltage_max", "safe_voltage", "max_slew_rate", "ramp_rate")
"""Parameters of the driver under ``in_force.`` that limit a protocol."""

_POLL_INTERVAL = 0.5
"""Time between two requests to the driver [s]."""

_FRESH = 3.0
"""Largest age of a status of the driver that counts as its present state [s]."""

_CLAIM_INTERVAL = 0.5
"""Time between repetitions of a claim [s]."""

_SAFE_WITHIN = 5e-3
"""Largest distance from the safe voltage that counts as safe [V]; converters round, and measured voltages are noisy."""

_PLACE_TOLERANCE = 0.01
"""Largest distance from the first voltage of a phase at which the phase may begin, in spans of the drive."""


class DriverClient:
    """Asks the driver for its limits, sends phases to it, and tracks their state.

    Parameters
    ----------
    node : GuardedNode
        The identification node.
    driver : str
        Name of the driver node in the same namespace.

    Attributes
    ----------
    limits : DriveLimits or None
        Limits of the driver; None while there is no configured driver.
    state, reason : str
        State of the last phase: ``sending``, ``sent``, ``accepted``, ``playing``, ``done``, ``refused`` or ``stopped``.
    first_index : int
        Index of its first sample, once it plays.
    command_max_age : float
        Largest age of a command that the driver plays [s].
    stopped : str
        Reason why the driver accepts no command; empty where it was not stopped.
    voltages : int
        Number of messages on 'voltage' so far.
    owner : str
        Name with which this client claims the stage.
    holder : str
        Present owner of the claim; empty where the stage is not claimed.
    """

    def __init__(self, node: GuardedNode, driver: str) -> None:
        self._node, self._driver = node, driver
        self.limits: DriveLimits | None = None
        self.state = self.reason = self.stopped = ""
        self._refused_voltage, self._refused_at = "", -math.inf
        self.first_index, self.voltages, self.command_max_age = 0, 0, 0.0
        self.owner, self.holder = f"{node.get_name()}.{os.getpid()}", ""
        self._claims = advertise(node, "claim")
        self._is_claiming = self._has_owned = False
        self._sent: tuple[str, str] | None = None
        self._newest: float | None = None
        self._pending: Future | None = None
        self._asked = self._answered = -math.inf
        self._parameters = AsyncParameterClient(node, driver)
        self._stop = node.create_client(Trigger, f"{driver}/cancel")  # a stop by somebody else is not released
        self._command = CommandSender(node)
        subscribe(node, "command_status", self._on_status)
        subscribe(node, "voltage", self._on_voltage)
        subscribe(node, "claimed_by", self._on_holder)
        node.create_timer(_CLAIM_INTERVAL, self._repeat_claim, clock=Clock(clock_type=ClockType.STEADY_TIME))
        node.create_timer(_POLL_INTERVAL, self._poll, clock=Clock(clock_type=ClockType.STEADY_TIME))

    @property
    def is_fresh(self) -> bool:
        """True where the driver has answered within the last seconds; ROS lists a killed driver for some time."""
        return time.monotonic() - self._answered < _FRESH

    @property
    def missing(self) -> str:
        """What is missing before a phase can be sent; empty where nothing is missing."""
        if self.limits is None:
            return f"a configured '{self._driver}' in {self._node.get_namespace()}"
        if not self.is_fresh:
            return f"an answer of '{self._driver}', which has ended or is busy"
        if not self._command.reaches(self._driver):
            return f"a subscription of '{self._driver}' to 'command'"
        if self._newest is None:
            return "a first 'voltage'; is the driver active?"
        return ""

    @property
    def blocked(self) -> str:
        """Why the driver refuses commands of this client; empty where it accepts them."""
        if self.stopped:
            return self.stopped
        if self.holder and not self.owns:
            return f"the stage is claimed by {printable(self.holder)}; wait until it is released"
        return ""

    @property
    def is_safe(self) -> bool:
        """True where the newest voltage is the safe one."""
        return (
            self.limits is not None
            and self._newest is not None
            and abs(self._newest - self.limits.safe_voltage) <= _SAFE_WITHIN
        )

    @property
    def owns(self) -> bool:
        """True while this client holds the claim."""
        return self.holder == self.owner

    def misplaced(self, voltage: float) -> str:
        """Where the stage is, if it is not at `voltage` [V]; empty where it is there, or its voltage is unknown."""
        is_near = self.distance(voltage) <= 1.0
        return "" if is_near else f"the stage is at {self._newest:.3g} V instead of {voltage:.3g} V"

    def distance(self, voltage: float) -> float:
        """Distance of the stage from `voltage` [V] in units of the tolerance; 0 where its voltage is unknown."""
        if self.limits is None or self._newest is None:
            return 0.0
        near = max(_SAFE_WITHIN, _PLACE_TOLERANCE * (self.limits.voltage_max - self.limits.voltage_min))
        return abs(self._newest - voltage) / near

    def claim(self) -> None:
        """Claim the stage. A granted claim is renewed until it is released; a claim that has ended is not renewed."""
        self._is_claiming, self._has_owned = True, False
        self._repeat_claim()

    def release(self) -> None:
        """Release the claim; the driver then brings the stage to its safe voltage."""
        if self._is_claiming:
            self._is_claiming = False
            send(self._claims, KeyValue(key=self.owner, value="release"))

    def _repeat_claim(self) -> None:
        if self._is_claiming:
            send(self._claims, KeyValue(key=self.owner, value="renew" if self._has_owned else "claim"))

    def _on_holder(self, message: String) -> None:
        self.holder = message.data
        self._has_owned = self._has_owned or (self._is_claiming and self.owns)

    def send(self, phase: ProtocolPhase) -> None:
        """Send a phase as a command, without waiting until it is sent."""
        self._sent, self.state, self.reason = None, "sending", ""

        def leaving(stamp: Time) -> None:
            self._sent, self.state = (phase.name, f"{stamp.sec}.{stamp.nanosec:09d}"), "sent"

        def lost(reason: str) -> None:
            self.state, self.reason = "refused", reason

        self._command.send(phase, self.owner if self.owns else "", leaving, lost)

    def stop(self) -> Future | None:
        """Ask the driver to end the present phase and go to the safe voltage; None where there is no driver.

        A phase that is being sent arrives first.
        """
        try:
            self._command.call_off(has_arrived=self.state not in ("sending", "sent"))
        except Exception as error:
            self._node.fault(error)
        self._sent = None
        return self._stop.call_async(Trigger.Request()) if self._stop.service_is_ready() else None

    def _poll(self) -> None:
        if self._pending is not None and not self._pending.done():
            if self._stop.service_is_ready() and time.monotonic() - self._asked < _FRESH:
                return
            self._pending.cancel()  # the driver was killed, and its successor has not received the request
        self._pending = None
        if not self._parameters.services_are_ready():
            self.limits = None
            return
        self._asked = time.monotonic()
        in_force = (f"in_force.{name}" for name in (*_NAMES, "stopped"))
        self._pending = self._parameters.get_parameters([*in_force, "command_max_age"])
        self._pending.add_done_callback(self._node.guarded(self._on_limits))

    def _on_limits(self, answer: Future) -> None:
        if answer.cancelled():
            return
        values = [parameter_value_to_python(value) for value in answer.result().values]
        self.command_max_age = (values.pop() if len(values) > 1 + len(_NAMES) else None) or 0.0
        stopped = values.pop() if len(values) > len(_NAMES) else False
        self.stopped = f"the driver was stopped and moves nothing; call {self._driver}/release first" if stopped else ""
        self.limits, self._answered = None, time.monotonic()
        if len(values) == len(_NAMES) and values[0]:
            try:
                self.limits = DriveLimits(**dict(zip(_NAMES, values, strict=True)))
            except (PiezoError, TypeError) as error:
                self._node.get_logger().warning(f"the driver's limits: {error}", throttle_duration_sec=10.0)

    def _on_voltage(self, message: Float64) -> None:
        self._newest = float(message.data)
        self.voltages += 1

    def refused_since(self, since: float) -> str:
        """Why a 'set_voltage' of this client or of another one was refused after `since`; empty if none was.

        Parameters
        ----------
        since : float
            Time on the clock of `time.monotonic` [s].
        """
        return self._refused_voltage if self._refused_at > since else ""

    def _on_status(self, status: DiagnosticStatus) -> None:
        values = values_of(status)
        if status.name == "set_voltage" and values.get("state") == "refused":
            self._refused_voltage, self._refused_at = status.message, time.monotonic()
        if self._sent == (status.name, values.get("stamp")):
            self.state, self.reason = values.get("state", ""), status.message
            first = values.get("first_index", "")
            if first.isdecimal() and len(first) <= 10:
                self.first_index = int(first)
