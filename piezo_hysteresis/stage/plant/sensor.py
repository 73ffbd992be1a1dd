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

"""The displacement sensor: bandwidth, nonlinearity, noise and analogue-to-digital converter."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...blocks.kernel import kernel
from .quantity import Group, quantity

Samples = NDArray[np.float64]

_FLICKER_LOWEST = 0.01
"""Lowest frequency of the 1/f noise [Hz]."""


@dataclass(frozen=True)
class Sensor(Group):
    """Capacitive sensor; its poles are discretised together with the mechanics.

    The nonlinearity is x + X [s2 (x/X)² + s3 (x/X)³] with X the full stroke.
    """

    bandwidth: float = quantity(7573.0, "Hz", 0.0, 1e9, "corner frequency of each pole; 0 for an unlimited sensor")
    poles: int = quantity(1, "1", 1, 6, "number of poles")
    quadratic: float = quantity(
        0.0, "1", -0.2, 0.2, "hidden effect: s2 of x + X [s2 (x/X)² + s3 (x/X)³], X the full stroke"
    )
    cubic: float = quantity(
        0.0, "1", -0.2, 0.2, "hidden effect: s3 of x + X [s2 (x/X)² + s3 (x/X)³], X the full stroke"
    )
    offset: float = quantity(0.0, "m", -1.0, 1.0, "reading at rest without drive")
    range: float = quantity(60e-6, "m", 1e-9, 1.0, "the converter spans ± this displacement")
    adc_bits: int = quantity(16, "1", 0, 32, "resolution of the converter; 0 for an ideal one")
    noise: float = quantity(5e-4, "1", 0.0, 0.1, "rms of white noise per sample, as a share of the full stroke")
    flicker: float = quantity(
        0.0, "1", 0.0, 0.1, "rms of 1/f noise per decade of frequency, as a share of the full stroke"
    )

    @property
    def time_constants(self) -> tuple[float, ...]:
        """Time constants of the poles [s]."""
        return (1 / (2 * math.pi * self.bandwidth),) * self.poles if self.bandwidth else ()

    @property
    def lsb(self) -> float:
        """One step of the converter [m]; 0 for an ideal one."""
        return 2 * self.range / 2**self.adc_bits if self.adc_bits else 0.0

    def distort(self, x: Samples, full: float) -> Samples:
        """Reading of the noise-free sensor [m] at displacement `x` [m]; `full` is the full stroke [m]."""
        if self.quadratic == 0.0 and self.cubic == 0.0:
            return x
        return np.asarray(x * (1.0 + (x / full) * (self.quadratic + self.cubic * (x / full))))

    def convert(self, y: Samples) -> Samples:
        """Output of the converter for `y` [m]; it clips beyond its range like a real converter."""
        half = 2 ** (self.adc_bits - 1) if self.adc_bits else 0
        if not self.adc_bits:
            return np.clip(y, -self.range, self.range)
        return np.clip(np.rint(y / self.lsb), -half, half - 1) * self.lsb


class Noise:
    """Sensor noise as a stream of samples. It is the same for one seed, for every size of the blocks.

    White noise of a fixed rms per sample, and 1/f noise as white noise through a cascade of one pole and one zero per
    decade, from 0.01 Hz to half the sample rate. The cascade starts from zero.
    """

    def __init__(self, sensor: Sensor, full: float, sample_period: float, seed: np.random.SeedSequence) -> None:
        white, flicker = seed.spawn(2)
        self._white, self._flicker = np.random.default_rng(white), np.random.default_rng(flicker)
        self._rms = sensor.noise * full
        decades = math.ceil(math.log10(0.5 / sample_period / _FLICKER_LOWEST))
        corner = 0.5 / sample_period * 10.0 ** -np.arange(1.0, max(decades, 1) + 1.0)
        self._pole = np.exp(-2 * math.pi * corner * sample_period)
        self._zero = np.exp(-2 * math.pi * corner * math.sqrt(10) * sample_period)
        self._state = np.zeros(corner.size)
        # S(f) = r² / (f ln 10) at the geometric middle fixes the gain
        middle = math.sqrt(corner[0] * corner[-1])
        z = np.exp(-2j * math.pi * middle * sample_period)
        shape = float(np.prod(np.abs((1 - self._zero * z) / (1 - self._pole * z))))
        wanted = sensor.flicker * full / math.sqrt(middle * math.log(10))
        self._gain = wanted / shape / math.sqrt(2 * sample_period)

    def run(self, size: int) -> Samples:
        """The next `size` samples [m]."""
        noise = self._rms * self._white.standard_normal(size) if self._rms else np.zeros(size)
        if self._gain:
            coloured = self._gain * self._flicker.standard_normal(size)
            _cascade(coloured, self._pole, self._zero, self._state)
            noise += coloured
        return noise


@kernel
def _cascade(x, pole, zero, state):
    for i in range(x.size):
        value = x[i]
        for k in range(pole.size):
            inner = value + pole[k] * state[k]
            value = inner - zero[k] * state[k]
            state[k] = inner
        x[i] = value
