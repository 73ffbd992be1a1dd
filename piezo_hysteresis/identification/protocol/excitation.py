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

"""Excitation waveforms in volts, inside the drive limits by construction.

Levels and amplitudes are fractions of the voltage range, so that a waveform fits every stage; on the range 0 to
10 V of the paper a fraction of 0.35 is 3.5 V. These functions make the waveform without ramps;
`DriveLimits.from_safe_to_safe` adds the ramps from and to the safe voltage.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .drive_limits import DriveLimits, Samples

HIGHEST = 0.2
"""Highest frequency of noise and multisine as a share of the sample rate."""
HIGHEST_SINE = 0.4
"""Highest frequency of a sine, also of one whose frequency rises, as a share of the sample rate."""


def possible_band(limits: DriveLimits, band: tuple[float, float], share: float) -> tuple[float, float]:
    """Lowest and highest frequency [Hz] of a drive, lowered where they exceed this share of the sample rate.

    >>> [possible_band(DriveLimits(1e-3), band, HIGHEST) for band in ((20.0, 3000.0), (1.0, 10.0))]
    [(20.0, 200.0), (1.0, 10.0)]
    """
    highest = min(band[1], share / limits.sample_period)
    return min(band[0], 0.1 * highest), highest


def hold(limits: DriveLimits, level: float, duration: float) -> Samples:
    """Constant level [V] for `duration` [s]."""
    return np.full(limits.samples(duration), limits.volts(level))


def steps(limits: DriveLimits, levels: Sequence[float], duration: float, slew_rate: float = np.inf) -> Samples:
    """Jump from level to level and hold each for `duration` (steps, trapezoids, staircase).

    Parameters
    ----------
    limits : DriveLimits
        Clock and limits.
    levels : sequence of float
        Fractions of the voltage range, in order.
    duration : float
        Hold after every edge [s].
    slew_rate : float
        Slope of the edges [V/s]; default: one sample, or the slew limit if it is slower.

    Returns
    -------
    (n,) array
        Voltage [V].
    """
    parts = [hold(limits, levels[0], duration)]
    for before, after in zip(levels, levels[1:], strict=False):
        edge = limits.path(limits.volts(np.array([before, after])), slew_rate)[1:-1]
        parts += [edge, hold(limits, after, duration)]
    return np.concatenate(parts)


def ramps(limits: DriveLimits, corners: Sequence[float], slew_rate: float) -> Samples:
    """Straight lines through `corners` (fractions of the range) at `slew_rate` [V/s]: minor loops, conditioning."""
    return limits.path(limits.volts(np.asarray(corners, dtype=np.float64)), slew_rate)


def triangle(limits: DriveLimits, peaks: Sequence[float], frequency: float, base: float = 0.0) -> Samples:
    """Triangle of several amplitudes, one period each: base, peak, base, next peak, … (paper, Sec. 3.4).

    Parameters
    ----------
    limits : DriveLimits
        Clock and limits.
    peaks : sequence of float
        Upper turning points as fractions of the range.
    frequency : float
        Fundamental frequency [Hz].
    base : float
        Lower turning point as fraction of the range.

    Returns
    -------
    (n,) array
        Voltage [V].
    """
    half = limits.samples(0.5 / frequency)
    rise = np.arange(half) / half
    parts = []
    for peak in peaks:
        parts += [base + (peak - base) * rise, peak - (peak - base) * rise]
    return limits.volts(np.append(np.concatenate(parts), base))


def sine(
    limits: DriveLimits, frequency: float, duration: float, centre: float = 0.35, amplitude: float = 0.25
) -> Samples:
    """Centre + amplitude·sin(2π f t), by default the 3.5 + 2.5 sin(2π f t) V of the paper, Table 1."""
    phase = 2.0 * np.pi * frequency * limits.sample_period * np.arange(limits.samples(duration) + 1)
    return limits.volts(centre + amplitude * np.sin(phase))


def chirp(limits: DriveLimits, band: tuple[float, float], duration: float, centre: float, amplitude: float) -> Samples:
    """Sine whose frequency rises exponentially through `band` [Hz], as far as it is possible, in `duration` [s]."""
    lowest, highest = possible_band(limits, band, HIGHEST_SINE)
    time = limits.sample_period * np.arange(limits.samples(duration) + 1)
    rate = np.log(highest / lowest) / duration
    phase = 2.0 * np.pi * lowest * np.expm1(rate * time) / rate
    return limits.volts(centre + amplitude * np.sin(phase))


def _random_phase(limits: DriveLimits, lines: np.ndarray, period: int, seed: int) -> Samples:
    """One period of a sum of equal cosines at the FFT `lines` with random phases and unit RMS."""
    spectrum = np.zeros(period // 2 + 1, dtype=np.complex128)
    spectrum[lines] = np.exp(2j * np.pi * np.random.default_rng(seed).random(lines.size))
    wave = np.fft.irfft(spectrum, period)
    return np.asarray(wave / np.std(wave))


def noise(limits: DriveLimits, rms: float, bandwidth: float, duration: float, centre: float, seed: int) -> Samples:
    """Band-limited white noise about `centre` (paper, Sec. 3.3), faded in and out over 2 % of its length.

    The noise has a flat spectrum up to `bandwidth` and random phases. If peaks exceed the range, it is scaled down.

    Parameters
    ----------
    limits : DriveLimits
        Clock and limits.
    rms : float
        Standard deviation as fraction of the range.
    bandwidth : float
        Highest frequency [Hz]; at most the Nyquist frequency.
    duration : float
        Length [s].
    centre : float
        Mean as fraction of the range.
    seed : int
        Seed of the phases.

    Returns
    -------
    (n,) array
        Voltage [V].
    """
    count = limits.samples(duration)
    highest = min(count // 2 - 1, int(bandwidth * limits.sample_period * count))
    wave = rms * _random_phase(limits, np.arange(1, max(highest, 1) + 1), count, seed)
    fade = max(1, count // 50)
    window = np.ones(count)
    window[:fade] = 0.5 - 0.5 * np.cos(np.pi * np.arange(fade) / fade)
    window[-fade:] = window[:fade][::-1]
    return limits.volts(centre + _fit(wave * window, centre))


def _fit(wave: Samples, centre: float) -> Samples:
    room = min(centre, 1.0 - centre)
    peak = float(np.max(np.abs(wave), initial=0.0))
    return wave if peak <= room else wave * (room / peak)


def multisine(
    limits: DriveLimits, fundamental: float, highest: float, amplitude: float, periods: int, centre: float, seed: int
) -> Samples:
    """Periodic odd multisine: odd harmonics up to `highest` with equal amplitude and random phases.

    Even-order distortion then appears at the even lines, which are not excited.

    Parameters
    ----------
    limits : DriveLimits
        Clock and limits.
    fundamental, highest : float
        Line spacing and upper edge [Hz].
    amplitude : float
        Peak as fraction of the range.
    periods : int
        Number of periods; the first contains the transient.
    centre : float
        Mean as fraction of the range.
    seed : int
        Seed of the phases.

    Returns
    -------
    (n,) array
        Voltage [V].
    """
    period = limits.samples(1.0 / fundamental)
    lines = np.arange(1, min(int(highest / fundamental), period // 2 - 1) + 1, 2)
    wave = _random_phase(limits, lines, period, seed)
    # a start at a zero crossing avoids a jump
    wave = np.roll(wave, -int(np.argmin(np.abs(wave))))
    wave *= amplitude / np.max(np.abs(wave))
    return limits.volts(centre + _fit(np.tile(wave, periods), centre))


def nested_loops(outer: float, levels: int, centre: float = 0.5) -> tuple[float, ...]:
    """Corners of nested loops, inwards and outwards again: 0, +outer, −…, inner, …, +outer, 0 about `centre`."""
    inward = [centre + (-1) ** k * outer * (1.0 - k / levels) for k in range(levels)]
    return (0.0, *inward, *reversed(inward), 0.0)


def decaying_loops(outer: float, ratio: float, count: int, centre: float = 0.5) -> tuple[float, ...]:
    """Corners of loops about `centre` whose amplitude decreases by `ratio` each half turn; they end at `centre`."""
    return (*(centre + outer * (-ratio) ** k for k in range(count)), centre)


def mixture(limits: DriveLimits, duration: float, seed: int) -> Samples:
    """Random turning points at random speeds, two random sines and weak noise, for validation.

    Parameters
    ----------
    limits : DriveLimits
        Clock and limits.
    duration : float
        Length [s].
    seed : int
        Seed of the random numbers.

    Returns
    -------
    (n,) array
        Voltage [V].
    """
    random = np.random.default_rng(seed)
    count = limits.samples(duration)
    time = limits.sample_period * np.arange(count)
    turns = np.concatenate([[0.0], np.cumsum(random.uniform(0.05, 0.35, max(2, int(duration / 0.05))))])
    corners = random.uniform(0.2, 0.8, turns.size)
    wave = np.interp(time, turns, corners)
    lowest, highest = np.log(possible_band(limits, (20.0, 400.0), HIGHEST_SINE))
    for frequency in np.exp(random.uniform(lowest, highest, 2)):
        start = random.uniform(0.0, 0.5) * duration
        wave += np.where(time >= start, 0.06 * np.sin(2.0 * np.pi * frequency * (time - start)), 0.0)
    wave += _fit(0.005 * _random_phase(limits, np.arange(1, max(2, count // 10)), count, seed), 0.02)
    return limits.volts(wave)
