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

"""`LearningFilter`: the share of the error that a round of learning corrects, as a function of frequency."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..errors import ModelError
from ..model.model import Model
from ..model.parameter_covariance import response_error

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False, slots=True)
class ResponseCheck:
    """Ratio of the measured frequency response of the stage to that of the model, with its uncertainty.

    Parameters
    ----------
    frequency : (k,) ndarray
        Rising frequencies [Hz].
    ratio : (k,) complex ndarray
        Measured response divided by that of the model.
    deviation : (k,) ndarray
        Standard deviation of the ratio, relative to the ratio.
    """

    frequency: Array
    ratio: NDArray[np.complex128]
    deviation: Array

    @classmethod
    def of(cls, model: Model, frequency: Array) -> ResponseCheck | None:
        """Check from the identified dynamics: the ratio is 1, and its deviation follows from the covariance.

        Parameters
        ----------
        model : Model
            Identified model.
        frequency : (k,) ndarray
            Rising frequencies below half the sampling rate [Hz].

        Returns
        -------
        ResponseCheck or None
            None if the model has no covariance of its parameters.
        """
        known = model.covariance
        if known is None:
            return None
        deviation = response_error(model, known.names, known.matrix, frequency)
        return cls(frequency, np.ones(frequency.size, dtype=np.complex128), deviation)


@dataclass(frozen=True, eq=False, slots=True)
class LearningFilter:
    """Gain of the correction as a function of frequency.

    A round changes the error E to (1 − L R) E, with the response R of stage and inverse in series. The error decreases
    if |1 − L R| < 1. The gain L falls to zero where this does not hold with a margin of two standard deviations.

    Parameters
    ----------
    sample_period : float
        Sample period [s].
    passed, stopped : float
        The gain is `gain` up to `passed` and falls to zero at `stopped`, as a raised cosine [Hz].
    gain : float
        Largest gain, above 0 and at most 1.
    check : ResponseCheck, optional
        Uncertainty of the identified response. Default: the response is exact.
    margin : float
        |1 − L R| plus two standard deviations must be at most 1 − margin · L.

    Raises
    ------
    ModelError
        If the numbers contradict one another, or no frequency is left at which a round converges.
    """

    sample_period: float
    passed: float = 1200.0
    stopped: float = 3000.0
    gain: float = 0.9
    check: ResponseCheck | None = None
    margin: float = 0.05

    def __post_init__(self) -> None:
        if not 0.0 < self.gain <= 1.0 or not 0.0 < self.passed < self.stopped or not 0.0 < self.margin < 1.0:
            raise ModelError(
                f"learning: got gain {self.gain:g}, {self.passed:g} to {self.stopped:g} Hz, margin {self.margin:g}, "
                "expected 0 < gain <= 1, 0 < passed < stopped, 0 < margin < 1"
            )
        if not self.at(np.linspace(0.0, self.stopped, 200)).any():
            raise ModelError(
                "learning: convergence is not certain at any frequency; first identify the dynamics more accurately"
            )

    def at(self, frequency: Array) -> Array:
        """Gain L at frequencies [Hz], shape (k,)."""
        f = np.abs(np.asarray(frequency, dtype=np.float64))
        share = np.clip((f - self.passed) / (self.stopped - self.passed), 0.0, 1.0)
        gain = self.gain * (0.5 + 0.5 * np.cos(np.pi * share))
        return np.asarray(np.where(self._factor(f, gain) <= 1.0 - self.margin * gain, gain, 0.0))

    def factor(self, frequency: Array) -> Array:
        """Upper bound of |1 − L R| at frequencies [Hz]: the largest factor by which a round multiplies the error."""
        return self._factor(np.asarray(frequency, dtype=np.float64), self.at(frequency))

    def _factor(self, f: Array, gain: Array) -> Array:
        ratio, spread = np.ones(f.size, dtype=np.complex128), np.zeros(f.size)
        if self.check is not None:
            own = self.check
            ratio = np.interp(f, own.frequency, own.ratio.real) + 1j * np.interp(f, own.frequency, own.ratio.imag)
            spread = np.abs(ratio) * np.interp(f, own.frequency, own.deviation)
        return np.asarray(np.abs(1.0 - gain * ratio) + 2.0 * gain * spread)

    def correct(self, error: Array, noise: float) -> tuple[Array, float, float]:
        """Correction for an error, and the error that is predicted after the round.

        Spectral lines with less than three times the power of the noise are not corrected.

        Parameters
        ----------
        error : (n,) ndarray
            Wanted minus measured displacement along the path [m].
        noise : float
            RMS of white sensor noise [m].

        Returns
        -------
        correction : (n,) ndarray
            Correction to add to the reference [m].
        left : float
            RMS error predicted after the round, without measurement noise [m].
        now : float
            RMS of the present error in the band of the filter, without noise [m].
        """
        n = error.size
        whole = np.concatenate((error, error[::-1]))  # mirrored, so that the periodic signal has no step
        size = whole.size
        spectrum = np.fft.rfft(whole)
        gain = self.at(np.asarray(np.fft.rfftfreq(size, self.sample_period), dtype=np.float64))
        power = np.abs(spectrum) ** 2
        floor = size * noise**2
        smooth = np.convolve(power, np.ones(5) / 5.0)[2:-2]
        known = np.maximum(0.0, 1.0 - 3.0 * floor / np.maximum(smooth, 1e-300)) if floor > 0.0 else np.ones(power.size)
        weight = gain * known
        correction = np.fft.irfft(weight * spectrum, size)[:n]
        signal = power - floor  # negative terms are kept, so that the sum over pure noise is zero on average
        lines = np.where(gain > 0.0, 2.0, 0.0) / size**2
        lines[[0, -1]] *= 0.5  # those at dc and at the Nyquist frequency have no partner of negative frequency
        left = max(0.0, float(lines @ ((1.0 - weight) ** 2 * signal + weight**2 * np.minimum(floor, power))))
        now = max(0.0, float(lines @ signal))
        return correction, math.sqrt(left), math.sqrt(now)
