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

"""`SetPoint`: holds one displacement, with an optional slow integral of the measured error."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from typing import Any

import numpy as np
from std_msgs.msg import Float64

from ...compensation import Limits
from ...errors import ModelError
from ...model.model import Model
from ..identification.driver_client import DriverClient
from ..runtime.sending import send

_INTERVAL = 0.1
"""Time between two corrections [s]; the driver ramps to each of them."""
_TURNS_WITHIN = 0.5
"""Time in which a stage that moves away from a new voltage turns [s]."""


def volts_per_metre(model: Model, limits: Limits) -> float:
    """Voltage for a displacement, of a stage that rests at one limit and then at the other [V/m].

    Raises
    ------
    ModelError
        If the model rests at one displacement at both limits.
    """
    ends = limits.voltage_min, limits.voltage_max
    low, high = (float(model.run([voltage], model.rest(voltage))[0][0]) for voltage in ends)
    if low == high:
        raise ModelError(
            f"model: got {1e6 * low:.4g} µm at rest at {ends[0]:g} V and at {ends[1]:g} V, expected a displacement "
            "that follows the voltage; identify again"
        )
    return (ends[1] - ends[0]) / (high - low)


class SetPoint:
    """Voltage for a displacement that is held.

    The integral is slow, because a fast feedback loop belongs in the controller of the stage. It stops where the
    voltage is at a limit, and until the stage has reached the last voltage that was sent. A stage that leaves that
    voltage afterwards, or moves away from it before, is moved by something else, and the hold ends.

    Parameters
    ----------
    publisher : rclpy.publisher.Publisher
        Publisher of `set_voltage`.
    integral_time : float
        Time constant with which a constant error is corrected [s]; below the interval of the corrections, each of them
        corrects the whole error. 0 switches the integral off.
    """

    def __init__(self, publisher: Any, integral_time: float) -> None:
        self._publisher, self._integral_time = publisher, integral_time
        self._target: float | None = None
        self._voltage = self._slope = 0.0
        self._limits, self._sent_at = Limits(), math.inf
        self._in_motion = False
        self._await_arrival()

    def _await_arrival(self) -> None:
        """The stage is on the way to a new voltage: the error is counted from its arrival on."""
        self._waited, self._sum, self._count = 0.0, 0.0, 0
        self._has_arrived, self._nearest, self._away = False, np.inf, 0.0

    @property
    def is_holding(self) -> bool:
        """Whether a displacement is held."""
        return self._target is not None

    def go(self, target: float, voltage: float, slope: float, limits: Limits, in_motion: bool = False) -> None:
        """Hold a displacement [m] by a voltage [V].

        Parameters
        ----------
        target, voltage : float
            Displacement [m], and the voltage for it [V].
        slope : float
            Slope of voltage against displacement [V/m].
        limits : Limits
            Limits of the voltage.
        in_motion : bool
            True if the stage moved when the voltage was computed; it has gone further than was known then.
        """
        self._in_motion = in_motion or (self.is_holding and not self._has_arrived)
        self._target, self._voltage, self._slope, self._limits = target, voltage, slope, limits
        self._send()

    def to_plan_again(self, at_rest: bool) -> float | None:
        """Displacement [m] of a stage that has arrived, if its voltage was computed while it moved; else None."""
        if self._target is None or not (self._in_motion and self._has_arrived and at_rest):
            return None
        self._in_motion = False
        return self._target

    def leave(self) -> None:
        """End the hold, because something else drives the stage."""
        self._target = None

    def hold(self, elapsed: float, driver: DriverClient, lost: Callable[[str], None]) -> None:
        """Advance by `elapsed` seconds. A driver that is stopped, gone or elsewhere ends the hold; `lost` tells why."""
        if self._target is None:
            return
        why = driver.missing and f"no driver: waiting for {driver.missing}"
        why = why or driver.blocked
        distance = driver.distance(self._voltage)
        on_the_way = not self._has_arrived and distance > 1.0  # behind the arrival, a voltage of another client
        if on_the_way and not why and (refused := driver.refused_since(self._sent_at)):
            why = f"the driver refused: {refused}"
        if not why and self.has_left(distance, elapsed):
            why = driver.misplaced(self._voltage)
        if why:
            self.leave()
            lost(why)
        else:
            self.tick(elapsed)

    def has_left(self, distance: float, elapsed: float) -> bool:
        """Whether something else moves the stage; `distance` is that from the voltage that was sent, in tolerances."""
        if distance <= 1.0:
            self._has_arrived = True
        elif not self._has_arrived:
            self._waited, self._sum, self._count = 0.0, 0.0, 0  # still on the way
            self._away = self._away + elapsed if distance > self._nearest + 1.0 else 0.0
            self._nearest = min(self._nearest, distance)
            return self._away > _TURNS_WITHIN
        return distance > 1.0

    def measured(self, mean: float, count: int) -> None:
        """Add the mean displacement [m] of a number of samples."""
        if self._target is not None:
            self._sum, self._count = self._sum + mean * count, self._count + count

    def tick(self, elapsed: float) -> None:
        """Advance by `elapsed` seconds."""
        self._waited += elapsed
        if self._target is None or not self._integral_time or self._waited < _INTERVAL or not self._count:
            return
        error = self._target - self._sum / self._count
        share = min(self._waited / self._integral_time, 1.0)  # more than the error makes the loop unstable
        wanted = self._voltage + self._slope * error * share
        self._voltage = float(np.clip(wanted, self._limits.voltage_min, self._limits.voltage_max))
        self._send()

    def _send(self) -> None:
        self._await_arrival()
        self._sent_at = time.monotonic()
        send(self._publisher, Float64(data=self._voltage))
