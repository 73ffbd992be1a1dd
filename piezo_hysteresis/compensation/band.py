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

"""`Band`: the frequency band of a wanted displacement."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..blocks.arx import arx_row, difference_equation, padded
from ..blocks.block import State
from ..blocks.inverses.inverted_block import InvertedBlock
from ..c_form import CForm
from ..errors import ModelError

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Band:
    """Low-pass filter of linear phase: its gain is 1 up to `passed` and falls to 0 at `stopped`, as a raised cosine.

    Parameters
    ----------
    passed, stopped : float
        Upper end of the pass band, and lower end of the stop band [Hz]; 0 < `passed` < `stopped`.
    length : float
        Duration of the impulse response, above 0 [s]; the filter needs the path half of this time ahead.

    Raises
    ------
    ModelError
        If `passed` is not positive or not below `stopped`, or `length` is not positive.
    """

    passed: float = 2000.0
    stopped: float = 5000.0
    length: float = 4e-3

    def __post_init__(self) -> None:
        if not 0.0 < self.passed < self.stopped:
            raise ModelError(f"band: got {self.passed:g} to {self.stopped:g} Hz, expected 0 < passed < stopped")
        if not 0.0 < self.length < np.inf:
            raise ModelError(f"band: got a length of {self.length:g} s, expected a finite time above 0 s")

    @classmethod
    def of(cls, sample_period: float) -> Band:
        """Default band for a sample period [s]: 2 kHz to 5 kHz at 50 kHz sampling, in proportion at other rates."""
        rate = 1.0 / sample_period
        return cls(0.04 * rate, 0.1 * rate, 200.0 * sample_period)

    def taps(self, sample_period: float) -> Array:
        """Symmetric impulse response with sum 1, shape (2 k + 1,), at a sample period [s].

        Raises
        ------
        ModelError
            If `stopped` is not below half the sample rate.
        """
        if self.stopped >= 0.5 / sample_period:
            raise ModelError(f"band: got {self.stopped:g} Hz, expected less than half the sample rate")
        half = max(1, round(0.5 * self.length / sample_period))
        t = sample_period * np.arange(-half, half + 1)
        middle, width = self.passed + self.stopped, self.stopped - self.passed
        near = 2.0 * width * t
        pole = np.isclose(np.abs(near), 1.0)
        shape = np.where(pole, np.pi / 4.0, np.cos(np.pi * width * t) / np.where(pole, 1.0, 1.0 - near**2))
        taps = np.sinc(middle * t) * shape * np.cos(0.5 * np.pi * np.arange(-half, half + 1) / (half + 1)) ** 2
        return np.asarray(taps / taps.sum())

    def stage(self, sample_period: float) -> BandFilter:
        """The filter as a stage of the inverse."""
        return BandFilter(self.taps(sample_period))


class BandFilter(InvertedBlock):
    """A symmetric filter; its output needs the input up to half its length ahead."""

    def __init__(self, taps: Array) -> None:
        self.preview, self.is_exact = taps.size // 2, False
        self.noise_gain = float(np.abs(taps).sum())
        self._taps = padded(taps)

    def start(self, x0: float, state: State, ahead: int) -> State:
        return x0, np.zeros(self._taps.size - 1)

    def run(self, y: Array, state: State, time: Array) -> tuple[Array, State]:
        x0, z = state[0], state[1].copy()
        x = np.empty_like(y)
        arx_row(y, x0, x0, self._taps, 0, np.zeros(0), z, x)
        return x, (x0, z)

    def c_form(self, ahead: int) -> CForm:
        rest = "s->x_rest = s->y_rest = x;\nreturn x;"
        return difference_equation(self._taps, 0, np.zeros(0), rest)
