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

"""`ExcitationContent`: what a record can show, judged from its drive: loops, dynamics, noise."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...record import Record, Samples
from .noise import noise_of, noise_on_motion, travel, voltage_noise
from .once import once_per_record
from .steady_waves import is_row_of_waves, rates_of_waves

SLOW = 30.0
"""Frequency below which a drive shows the dynamics of a stage only as a lag [Hz]."""
MANY_LINES = 48
"""Smallest number of spectral lines of a drive that determines the order of the dynamics."""
MANY_MOMENTS = 12.0
"""Smallest effective number of samples in which it changes; one step is not enough."""
MARKED = 0.95
"""Share of the power of dv/dt that defines bandwidth and number of lines."""
UNMEASURED = 5e-4
"""Share of the range below which the highest frequencies of a drive are noise of the recorder and not excitation."""
ABOVE = 1.25
"""The same, in standard deviations of the noise that the drive was measured with."""
MOVES = 0.02
"""Share of the largest range of the drive from which a record shows frequencies; below it is a rest."""
RINGS = 0.05
"""Longest ringing of a stage after a step [s]; a drive that is held for longer shows the same step response again."""
HELD = 32
"""Smallest number of samples of such a hold."""
HARMONIC = 2.0
"""Ratio of bandwidth and rate of a wave below which it has no harmonics, and the bandwidth is that of a short wave."""
ONE_WAY = 0.9
"""Share of the motion of such a drive that the net changes between its levels are."""


@dataclass(frozen=True, slots=True)
class ExcitationContent:
    """What the drive of a record excites, and how quiet its sensor is.

    Parameters
    ----------
    span : float
        Range of the drive, including the settled voltage before it [V].
    bandwidth : float
        Frequency below which 95 % of the power of dv/dt lies [Hz].
    slowest : float
        Frequency above which 95 % of this power lies [Hz], at least that of half a cycle in the record.
    lines : int
        Number of spectral lines with 95 % of this power.
    moments : float
        Effective number of samples in which the drive changes, the smaller of (Σ x²)²/Σ x⁴ for dv and d²v: a jump in a
        slow drive has little of the power of dv, but all of the power of d²v.
    noise : float
        Standard deviation of the sensor noise [m].
    waves : bool
        Whether the drive consists of sines or triangles of a few rates, one after another.
    levels : bool
        Whether the drive moves from level to level and is held there: every change shows the same step response.
    highest : float
        Highest frequency of the drive [Hz]: the rate of the fastest sine, around which the power of a short one is
        spread, and the bandwidth of other drives.
    """

    span: float
    bandwidth: float
    slowest: float
    lines: int
    moments: float
    noise: float
    waves: bool = False
    levels: bool = False
    highest: float = 0.0

    @property
    def is_broadband(self) -> bool:
        """True if the drive determines linear dynamics."""
        is_rich = self.bandwidth > SLOW and self.lines >= MANY_LINES and self.moments >= MANY_MOMENTS
        return is_rich and not (self.waves or self.levels)

    @property
    def is_step(self) -> bool:
        """True if the drive changes in a few samples only, or from level to level: its spectrum has no end."""
        return self.moments < MANY_MOMENTS or self.levels

    @property
    def is_slow(self) -> bool:
        """True if the stage follows the drive with only a lag."""
        return self.bandwidth <= SLOW


@once_per_record
def excitation_content(record: Record) -> ExcitationContent:
    """Judge a record by the spectrum of its dv/dt and the noise of its displacement."""
    span = travel(record)
    noise = float(voltage_noise((record,))[0])
    spectrum = _excitation(np.diff(record.voltage), max(UNMEASURED * span, ABOVE * noise))
    power = np.abs(spectrum) ** 2
    total = float(power.sum())
    if total == 0.0:
        return ExcitationContent(span, 0.0, 0.0, 0, 0.0, noise_of(record))
    speed = np.fft.irfft(spectrum, record.size - 1)
    frequency = np.arange(power.size) / (speed.size * record.sample_period)
    grown = np.cumsum(power)
    bandwidth = float(frequency[np.searchsorted(grown, MARKED * total)])
    slowest = max(float(frequency[np.searchsorted(grown, (1.0 - MARKED) * total)]), 0.5 / record.duration)
    lines = int(np.searchsorted(np.cumsum(np.sort(power)[::-1]), MARKED * total)) + 1
    moments = min(_spread(speed), _spread(np.diff(speed)))
    waves = is_row_of_waves(record.voltage, record.sample_period, bandwidth, noise)
    levels = _holds_levels(record.voltage, max(HELD, round(RINGS / record.sample_period)))
    rate = rates_of_waves(record.voltage, record.sample_period, noise)[1] if waves else bandwidth
    highest = min(rate, bandwidth) if bandwidth < HARMONIC * rate else bandwidth
    return ExcitationContent(span, bandwidth, slowest, lines, moments, noise_of(record), waves, levels, highest)


def moving(contents: Sequence[ExcitationContent]) -> list[ExcitationContent]:
    """Contents of the records whose drive moves noticeably; a rest that ends with the first volts does not."""
    largest = max((c.span for c in contents), default=0.0)
    return [c for c in contents if c.span >= MOVES * largest > 0.0]


def _excitation(speed: Samples, unmeasured: float) -> NDArray[np.complex128]:
    """Spectrum of dv, without the highest frequencies, where v does not exceed `unmeasured` [V]."""
    if not speed.size:
        return np.zeros(1, np.complex128)
    spectrum = np.fft.rfft(speed)
    angle = np.pi * np.arange(spectrum.size) / speed.size
    position = np.abs(spectrum[1:]) ** 2 / np.sin(angle[1:]) ** 2 / (2.0 * speed.size**2)
    beyond = np.cumsum(position[::-1])[::-1]  # power of v from each line on [V²]
    spectrum[1:][beyond < unmeasured**2] = 0.0
    return spectrum


def _holds_levels(voltage: Samples, held: int) -> bool:
    """Whether the drive is held for so many samples after every change, and every change goes one way."""
    change = np.diff(voltage)
    if change.size < held:
        return False
    moves = np.flatnonzero(np.abs(change) > 6.0 * noise_on_motion(voltage, 3))
    if not np.sum(change[moves] ** 2) > 0.5 * np.sum(change**2):
        return False  # it is noise
    starts = np.flatnonzero(np.concatenate(([True], np.diff(moves) >= held)))
    net = np.add.reduceat(change[moves], starts)
    return float(np.abs(net).sum()) >= ONE_WAY * float(np.abs(change[moves]).sum())


def _spread(values: Samples) -> float:
    """Effective number of samples that contain the power of a signal."""
    squares = values * values
    fourth = float(squares @ squares)
    return float(squares.sum()) ** 2 / fourth if fourth > 0.0 else 0.0


def excited_part(record: Record, window: int = 64) -> Record:
    """The part of a broadband record between its ramps, where the drive is curved everywhere."""
    curvature = np.abs(np.diff(record.voltage, 2))
    if curvature.size <= window or curvature.max() == 0.0:
        return record
    curved = curvature > 0.1 * np.quantile(curvature, 0.95)
    dense = np.convolve(curved, np.full(window, 1.0 / window), mode="same") > 0.5
    if not dense.any():
        return record
    return record[int(np.argmax(dense)) : dense.size - int(np.argmax(dense[::-1]))]
