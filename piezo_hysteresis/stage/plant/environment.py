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

"""Influences from outside: temperature, mains, and the motion of the other axis."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...blocks.kernel import kernel
from .quantity import Group, quantity

Samples = NDArray[np.float64]


@dataclass(frozen=True)
class Environment(Group):
    """Hidden effects that depend on absolute time, all off by default.

    From the start of the stage its temperature rises by `temperature_rise` (1 − exp(−t/`temperature_time`)). The other
    axis moves by q(t) = `other_amplitude` [0.7 sin(2π f t + a) + 0.3 sin(2π √7 f t + b)].
    """

    temperature: float = quantity(293.15, "K", 0.0, 1000.0, "temperature at the start")
    temperature_rise: float = quantity(1.0, "K", -100.0, 100.0, "final rise of temperature")
    temperature_time: float = quantity(600.0, "s", 0.1, 1e6, "time constant of the rise")
    thermometer: int = quantity(0, "1", 0, 1, "1 where the temperature is acquired")
    thermal_expansion: float = quantity(0.0, "m/K", -1e-3, 1e-3, "hidden effect: thermal drift of the displacement")
    gain_per_kelvin: float = quantity(0.0, "1/K", -0.1, 0.1, "hidden effect: gain drift")
    hum: float = quantity(0.0, "m", 0.0, 1.0, "hidden effect: amplitude of mains hum")
    hum_frequency: float = quantity(50.0, "Hz", 0.1, 1e4, "frequency of the mains")
    hum_harmonics: tuple[float, ...] = quantity((0.0, 0.3), "1", 0.0, 10.0, "2nd, 3rd, … harmonic over the first")
    coupling: float = quantity(
        0.0, "1", -1.0, 1.0, "hidden effect: share of the motion of the other axis that the sensor measures"
    )
    other_amplitude: float = quantity(
        0.0, "m", 0.0, 1.0, "amplitude of the motion of the other axis; 0 if there is none"
    )
    other_frequency: float = quantity(3.0, "Hz", 1e-3, 1e4, "frequency of the motion of the other axis")


class Surroundings:
    """State of the environment from absolute time `time` [s]; `phases` are random phases as fractions of 2π."""

    def __init__(self, environment: Environment, sample_period: float, time: float, phases: Samples) -> None:
        e = environment
        turn = 2 * math.pi
        relative = np.array([1.0, *e.hum_harmonics] if e.hum else [])
        orders = 1.0 + np.arange(relative.size)
        self._hum = e.hum * relative, turn * e.hum_frequency * orders, turn * np.resize(phases[2:], relative.size)
        ratios, shares = np.array([1.0, math.sqrt(7)]), np.array([0.7, 0.3])
        self._other = e.other_amplitude * shares, turn * e.other_frequency * ratios, turn * phases[:2]
        self._moves = e.other_amplitude > 0
        self._environment, self._period, self._start = e, sample_period, time
        self._count = 0
        self._warmth = np.array([-math.expm1(-time / e.temperature_time)])

    @property
    def time(self) -> float:
        """Absolute time of the next sample [s]."""
        return self._start + self._count * self._period

    def run(self, size: int) -> tuple[Samples, Samples | None, Samples]:
        """Rise of temperature [K], motion of the other axis [m] and hum [m] at the next `size` samples."""
        warmth, hum, other = np.empty(size), np.zeros(size), np.zeros(size)
        share = -math.expm1(-self._period / self._environment.temperature_time)
        _warm(self._warmth, share, warmth)
        if self._environment.hum:
            _lines(*self._hum, self._start, self._period, self._count, hum)
        if self._moves:
            _lines(*self._other, self._start, self._period, self._count, other)
        self._count += size
        return warmth * self._environment.temperature_rise, other if self._moves else None, hum


@kernel
def _warm(state, share, out):
    warmth = state[0]
    for i in range(out.size):
        out[i] = warmth
        warmth += share * (1.0 - warmth)
    state[0] = warmth


@kernel
def _lines(amplitude, frequency, phase, start, period, count, out):
    for i in range(out.size):
        t = start + (count + i) * period
        total = 0.0
        for k in range(phase.size):
            total += amplitude[k] * math.sin(frequency[k] * t + phase[k])
        out[i] = total
