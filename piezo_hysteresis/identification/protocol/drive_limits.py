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

"""`DriveLimits`: limits of the drive, and ramps between the safe voltage and a waveform."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...errors import IdentificationError
from ...parameter import slew_text

Samples = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class DriveLimits:
    """Sample period and limits of the drive; every waveform is made inside them.

    Parameters
    ----------
    sample_period : float
        Period at which the drive is played [s].
    voltage_min, voltage_max : float
        Limits of the drive before the amplifier [V].
    safe_voltage : float
        Voltage at which a waveform starts and ends [V].
    max_slew_rate : float
        Steepest change between two samples [V/s].
    ramp_rate : float
        Rate of the ramps between the safe voltage and a waveform [V/s].
    rest : float
        Rest at the safe voltage before and after a waveform [s].

    Raises
    ------
    IdentificationError
        If the limits contradict one another.
    """

    sample_period: float = 2e-5
    voltage_min: float = 0.0
    voltage_max: float = 10.0
    safe_voltage: float = 0.0
    max_slew_rate: float = math.inf
    ramp_rate: float = 50.0
    rest: float = 0.05

    def __post_init__(self) -> None:
        if not self.voltage_min < self.voltage_max:
            raise IdentificationError(
                f"voltage limits: got {self.voltage_min:g} to {self.voltage_max:g} V, "
                "expected a minimum below the maximum"
            )
        if not self.voltage_min <= self.safe_voltage <= self.voltage_max:
            raise IdentificationError(
                f"safe_voltage: got {self.safe_voltage:g} V, "
                f"expected {self.voltage_min:g} to {self.voltage_max:g} V, inside the limits"
            )
        for name in ("sample_period", "max_slew_rate", "ramp_rate"):
            if not getattr(self, name) > 0:
                raise IdentificationError(f"{name}: got {getattr(self, name)!r}, expected a positive number")

    @property
    def span(self) -> float:
        """Voltage range [V]."""
        return self.voltage_max - self.voltage_min

    def samples(self, duration: float) -> int:
        """Number of samples in `duration` [s], at least one."""
        return max(1, round(duration / self.sample_period))

    def volts(self, fraction: float | Samples) -> Samples:
        """Voltage at a fraction of the range, 0 at the minimum and 1 at the maximum [V].

        Raises
        ------
        IdentificationError
            If a fraction lies outside 0 to 1.
        """
        fraction = np.asarray(fraction, dtype=np.float64)
        low, high = float(fraction.min()), float(fraction.max())
        if not (low >= -1e-9 and high <= 1.0 + 1e-9):
            raise IdentificationError(f"waveform: got {low:.4g} to {high:.4g} of the voltage range, expected 0 to 1")
        return np.asarray(np.clip(self.voltage_min + self.span * fraction, self.voltage_min, self.voltage_max))

    def check(self, voltage: Samples, name: str) -> None:
        """Refuse a waveform that leaves the limits or does not start and end at the safe voltage.

        Raises
        ------
        IdentificationError
            If it does; the message names the waveform.
        """
        low, high = float(voltage.min()), float(voltage.max())
        if low < self.voltage_min or high > self.voltage_max:
            raise IdentificationError(
                f"{name}: got {low:g} to {high:g} V, expected {self.voltage_min:g} to {self.voltage_max:g} V"
            )
        slew = float(np.max(np.abs(np.diff(voltage)), initial=0.0)) / self.sample_period
        if slew > self.max_slew_rate * (1.0 + 1e-6):
            raise IdentificationError(
                f"{name}: got a slew of {slew_text(slew)}, expected at most {slew_text(self.max_slew_rate)}"
            )
        if voltage[0] != self.safe_voltage or voltage[-1] != self.safe_voltage:
            raise IdentificationError(
                f"{name}: got {voltage[0]:g} V first and {voltage[-1]:g} V last, "
                f"expected the safe voltage {self.safe_voltage:g} V"
            )

    def path(self, corners: Samples, rate: float) -> Samples:
        """Straight lines through `corners` at one rate, at most the slew limit; every corner is reached exactly.

        Parameters
        ----------
        corners : (k,) array
            Voltages to pass through [V]; repeated corners are passed once.
        rate : float
            Rate of change [V/s].

        Returns
        -------
        (n,) array
            Voltage [V], from the first corner to the last.
        """
        step = min(rate, self.max_slew_rate) * self.sample_period
        corners = np.asarray(corners, dtype=np.float64)
        parts = [corners[:1]]
        for begin, end in zip(corners, corners[1:], strict=False):
            count = math.ceil(abs(end - begin) / step * (1.0 - 1e-12))
            line = begin + (end - begin) * (np.arange(1, count + 1) / max(count, 1))
            line[-1:] = end
            parts.append(line)
        # rounding may change the corners by one bit
        return np.clip(np.concatenate(parts), corners.min(), corners.max())

    def within_slew(self, voltage: Samples) -> Samples:
        """Scale a waveform about its first voltage so that no step exceeds the slew limit."""
        steepest = float(np.max(np.abs(np.diff(voltage)), initial=0.0)) / self.sample_period
        if steepest <= self.max_slew_rate:
            return voltage
        shrunk = voltage[0] + (voltage - voltage[0]) * (self.max_slew_rate / steepest * (1.0 - 1e-9))
        return np.clip(shrunk, voltage.min(), voltage.max())

    def from_safe_to_safe(self, voltage: Samples) -> Samples:
        """Add rest and ramp before and after, so that a waveform starts and ends at the safe voltage.

        Parameters
        ----------
        voltage : (n,) array
            Waveform inside the voltage limits [V].

        Returns
        -------
        (m,) array
            Voltage [V]; first and last sample are the safe voltage.
        """
        rest = np.full(self.samples(self.rest), self.safe_voltage)
        body = self.within_slew(voltage)
        there = self.path(np.array([self.safe_voltage, body[0]]), self.ramp_rate)[1:-1]
        back = self.path(np.array([body[-1], self.safe_voltage]), self.ramp_rate)[1:-1]
        return np.concatenate([rest, there, body, back, rest])
