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

"""Converter and amplifier: from the requested drive to the voltage at the piezo, exact at every sub-step."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...blocks.kernel import kernel
from .clock import Clock
from .quantity import Group, quantity

Samples = NDArray[np.float64]


@dataclass(frozen=True)
class Electronics(Group):
    """Digital-to-analogue converter with hold, dead time, and the high-voltage amplifier.

    The amplifier is a first-order lag whose slope is limited: τ v̇ = clip(u − v, ±S τ), then saturates. Both have
    closed solutions while the converter holds.
    """

    dac_range: float = quantity(10.0, "V", 1e-3, 1e3, "the converter spans ± this drive voltage")
    dac_bits: int = quantity(16, "1", 0, 32, "resolution of the converter; 0 for an ideal one")
    voltage_min: float = quantity(0.0, "V", -1e3, 1e3, "lowest drive voltage that is accepted")
    voltage_max: float = quantity(10.0, "V", -1e3, 1e3, "highest drive voltage that is accepted")
    delay: float = quantity(47e-6, "s", 0.0, 0.1, "dead time of converters and electronics")
    extra_delay: float = quantity(0.0, "s", 0.0, 0.1, "hidden effect: more dead time")
    amplifier_gain: float = quantity(20.0, "V/V", 1e-3, 1e4, "piezo voltage over drive voltage")
    amplifier_bandwidth: float = quantity(10e3, "Hz", 0.0, 1e9, "corner frequency; 0 for an unlimited amplifier")
    amplifier_slew: float = quantity(0.0, "V/s", 0.0, 1e12, "hidden effect: slew limit at the piezo; 0 for none")
    amplifier_min: float = quantity(-20.0, "V", -1e4, 1e4, "lower rail at the piezo")
    amplifier_max: float = quantity(210.0, "V", -1e4, 1e4, "upper rail at the piezo")
    saturation_corner: float = quantity(0.0, "V", 0.0, 1e4, "width of the corner at the rails; 0 for a sharp clip")

    @property
    def lsb(self) -> float:
        """One step of the converter [V]; 0 for an ideal one."""
        return 2 * self.dac_range / 2**self.dac_bits if self.dac_bits else 0.0

    def convert(self, voltage: Samples) -> Samples:
        """Output of the converter [V]: the nearest step within the drive limits."""
        if not self.dac_bits:
            return np.array(voltage)
        half = 2 ** (self.dac_bits - 1)
        lowest = math.ceil(self.voltage_min / self.lsb - 1e-9)
        highest = min(math.floor(self.voltage_max / self.lsb + 1e-9), half - 1)
        return np.clip(np.rint(voltage / self.lsb), lowest, highest) * self.lsb


class Amplifier:
    """State of the electronics, settled at `voltage` [V]: from converted drive to drive at the piezo, per sub-step."""

    def __init__(self, electronics: Electronics, clock: Clock, voltage: float) -> None:
        gain, bandwidth = electronics.amplifier_gain, electronics.amplifier_bandwidth
        self.time_constant = 1 / (2 * math.pi * bandwidth) if bandwidth else 0.0
        slew = electronics.amplifier_slew / gain if electronics.amplifier_slew else math.inf
        corner = electronics.saturation_corner / gain
        self._limits = np.array(
            [self.time_constant, slew, electronics.amplifier_min / gain, electronics.amplifier_max / gain, corner]
        )
        self._step = np.array(clock.steps)[clock.kind]
        self._held = np.full(max(clock.holds, 1), voltage)
        self._holds = clock.holds
        self._state = np.array([voltage])
        self._oldest = np.zeros(1, dtype=np.int64)

    def settled(self) -> float:
        """Output of the settled amplifier [V]."""
        return float(_saturate(self._state[0], self._limits[2], self._limits[3], self._limits[4]))

    def run(self, voltage: Samples) -> Samples:
        """Drive at the piezo at the end of every sub-step [V], shape (n · count,)."""
        out = np.empty(voltage.size * self._step.size)
        _amplify(voltage, self._held, self._oldest, self._holds, self._state, self._step, self._limits, out)
        return out


@kernel
def _saturate(v: float, low: float, high: float, corner: float) -> float:
    if corner == 0.0:
        return min(max(v, low), high)
    v = high - corner * (np.logaddexp(0.0, (high - v) / corner))
    return low + corner * (np.logaddexp(0.0, (v - low) / corner))


@kernel
def _amplify(u, held, oldest, holds, state, step, limits, out):
    tau, slew, low, high, corner = limits[0], limits[1], limits[2], limits[3], limits[4]
    count = step.size
    v, k = state[0], oldest[0]
    decay = np.empty(count)
    for j in range(count):
        decay[j] = math.exp(-step[j] / tau) if tau > 0.0 else 0.0
    for i in range(u.size):
        target = u[i]
        if holds > 0:
            target, held[k] = held[k], u[i]
            k = k + 1 if k + 1 < holds else 0
        for j in range(count):
            gap = v - target
            free = abs(gap) - slew * tau
            if not free > 0.0:
                gap *= decay[j]
            elif free >= slew * step[j]:
                gap = math.copysign(abs(gap) - slew * step[j], gap)
            elif tau > 0.0:
                gap = math.copysign(slew * tau * math.exp(-(step[j] - free / slew) / tau), gap)
            else:
                gap = 0.0
            # an amplifier that has settled is set to its end, because arithmetic with subnormal numbers is slow
            v = target + gap if abs(gap) > 1e-14 else target
            out[i * count + j] = _saturate(v, low, high, corner)
    state[0], oldest[0] = v, k
