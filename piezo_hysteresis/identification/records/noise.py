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

"""Noise of sensor and voltage, estimated from the samples, and a drive without its noise."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import scipy

from ...effects.hysteresis.play import play_positions
from ...record import Experiment, Notice, Record, Samples

GAUSSIAN = 1.4826
"""Standard deviation over median absolute value."""
BENDS = (2, 4, 6)
"""Orders of the differences of a voltage that show its noise; high ones are small in waves, low ones at turns."""
FEWEST_BENDS = 50
"""Smallest number of such differences."""
WHITE = 0.75
"""Share of sign changes between the highest differences: 0.83 in white noise, 0.5 by chance, 0 in smooth curves."""
SMALLEST, LARGEST = 1e-6, 5e-3
"""Noise of a measured voltage, as a share of its range: less is not noticed, and more is a drive that is random."""
WINDOWS = (5, 7, 9, 11, 13, 17, 25, 33, 49, 65, 97, 129, 193, 257)
"""Numbers of samples over which a noisy voltage may be smoothed."""
WIDTH, NARROW = 0.5, 0.35
"""Half width of the plays that take away its turns, in standard deviations of the noise: of a smooth voltage, and of a
fast one, which has more turns of its own."""
OFTEN = 0.5
"""Share of samples at which a fast drive turns, above which a play would take its own turns; white noise has 2/3."""
AGREE = 2.5
"""Standard deviations within which the smooth voltages of two windows agree."""
VOLTAGE_NOISE = "voltage_noise"
"""Kind of the notice about a voltage that was measured with noise."""


def noise_of(record: Record, fewest: int = 64) -> float:
    """Standard deviation of the sensor noise [m].

    From the longest rest of the record after subtraction of a parabola. Without a rest of `fewest` samples, from third
    differences, which are near zero for a smooth motion.
    """
    y = record.displacement
    moves = np.flatnonzero(np.concatenate(([True], np.diff(record.voltage) != 0.0, [True])))
    longest = int(np.argmax(np.diff(moves))) if moves.size > 1 else 0
    start, stop = (int(moves[longest]), int(moves[longest + 1])) if moves.size > 1 else (0, y.size)
    # the stage rings after the drive stops, so only the later half is used
    start += (stop - start) // 2 if start > 0 else 0
    if stop - start >= fewest:
        t = np.linspace(-1.0, 1.0, stop - start)
        rest = y[start:stop] - np.polynomial.Polynomial.fit(t, y[start:stop], 2)(t)
        return float(np.std(rest))
    if y.size < 8:
        return 0.0
    return noise_on_motion(y, 3)


def noise_on_motion(values: Samples, order: int) -> float:
    """Standard deviation of white noise on a smooth motion, from differences of the given order.

    The differences have the power C(2 order, order), the sum of the squared binomial coefficients.

    Examples
    --------
    >>> noise = np.random.default_rng(0).normal(0.0, 0.1, 100_000)
    >>> round(noise_on_motion(np.sin(np.arange(100_000) / 300.0) + noise, 3), 2)
    0.1
    """
    typical = np.median(np.abs(np.diff(values, order)))
    return float(GAUSSIAN * typical / np.sqrt(math.comb(2 * order, order)))


def sensor_noise(records: Sequence[Record]) -> list[float]:
    """Standard deviation of the sensor noise of every record [m]: the smallest one of records at its sample period.

    All records have the same sensor, so a larger value in one record is motion, such as ringing after a step.
    """
    own = [min(noise_of(r), noise_on_motion(r.displacement, 3)) if r.size >= 8 else noise_of(r) for r in records]
    least: list[float] = []
    for record in records:
        near = 1e-3 * record.sample_period
        alike = zip(own, records, strict=True)
        least.append(min(n for n, other in alike if abs(other.sample_period - record.sample_period) < near))
    return least


def travel(record: Record) -> float:
    """Range of the drive in a record, from the level before it [V]."""
    return float(np.ptp(np.append(record.voltage, record.settled_voltage)))


def voltage_noise(records: Sequence[Record]) -> Samples:
    """Standard deviation of the voltage noise of every record [V]; 0 if the voltage is a command and not measured.

    High differences of noise change sign from one to the next; those of commanded ramps, holds and rests are zero.
    Longer block averages contain less noise.
    """
    long = [r for r in records if r.size >= FEWEST_BENDS + max(BENDS)]
    sizes = [min(noise_on_motion(r.voltage, order) for order in BENDS) for r in long]
    span = max(map(travel, records), default=0.0)
    least = min(sizes, default=0.0)
    if not SMALLEST * span < least <= LARGEST * span or not _is_white(long[sizes.index(least)].voltage):
        return np.zeros(len(records))
    density = min(s * r.sample_period**0.5 for s, r in zip(sizes, long, strict=True))
    return np.maximum(least, density / np.sqrt([r.sample_period for r in records]))


def _is_white(voltage: Samples) -> bool:
    bends = np.diff(voltage, max(BENDS))
    return bool(np.mean(bends[1:] * bends[:-1] < 0.0) > WHITE)


def quieted(record: Record, noise: float) -> Record:
    """The record with a smooth voltage, without the changes that noise of that size [V] makes.

    A hysteresis loop responds to every small turn of the voltage and loses memory, and a mode rings with it. The stage
    has not seen the measured noise, so the model must not see it. What is left of the noise would still turn the
    drive. A play takes these turns away, also where the drive is too fast to be smoothed.
    """
    if noise == 0.0:
        return record
    measured = np.array(record.voltage)
    smooth, share = _smooth(measured, noise)
    quiet = _without_turns(smooth, WIDTH * noise)
    # Stein's unbiased estimate of the squared error: a fast random drive is not smooth, and keeps its peaks
    error = (quiet - measured) ** 2 + (2.0 * share - 1.0) * noise**2
    near = np.minimum(scipy.ndimage.uniform_filter1d(error, WINDOWS[-1], mode="mirror"), noise**2)
    is_fast = near >= noise**2
    turns = np.diff(measured[1:]) * np.diff(measured[:-1]) < 0.0
    is_white = np.sum(turns & is_fast[1:-1]) > OFTEN * np.sum(is_fast)
    fast = measured if is_white else _without_turns(measured, NARROW * noise)
    voltage = np.where(is_fast, fast, quiet)
    return replace(record, voltage=voltage, voltage_noise=math.sqrt(max(0.0, float(near.mean()))))


def _without_turns(drive: Samples, width: float) -> Samples:
    """The mean of a play of half width `width` [V] that runs forward and of one that runs backward: it does not lag."""
    forward, backward = np.empty(drive.size), np.empty(drive.size)
    for way, followed in ((drive, forward), (drive[::-1].copy(), backward)):
        play_positions(way, width, way[0], followed)
    return np.asarray(0.5 * (forward + backward[::-1]))


def _smooth(values: Samples, noise: float) -> tuple[Samples, Samples]:
    """Cubics through a window around every sample, as long as those through all shorter windows agree with them.

    Two estimates agree if they differ by less than `AGREE` times the sum of their standard deviations, so that steps,
    sharp turns and fast waves stay (Goldenshluger & Nemirovski, Math. Methods Statist. 6 (1997) 135).

    Returns
    -------
    found : (n,) ndarray
        Smooth values.
    share : (n,) ndarray
        Share of the variance of the noise that is left in them.
    """
    found, left = values, np.ones(values.size)
    low, high = values - AGREE * noise, values + AGREE * noise
    for window in WINDOWS:
        if window > values.size:
            break
        fit = scipy.signal.savgol_filter(values, window, 3, mode="mirror")
        share = float(np.sum(scipy.signal.savgol_coeffs(window, 3) ** 2))
        error = AGREE * noise * math.sqrt(share)
        low, high = np.maximum(low, fit - error), np.minimum(high, fit + error)
        found, left = np.where(low <= high, fit, found), np.where(low <= high, share, left)
    return found, left


def without_voltage_noise(experiment: Experiment) -> tuple[Experiment, tuple[Notice, ...]]:
    """The experiment without the noise that its voltage was measured with, and a notice if there is any."""
    noise = voltage_noise(experiment.records)
    if not noise.any():
        return experiment, ()
    records = tuple(quieted(r, n) for r, n in zip(experiment.records, noise.tolist(), strict=True))
    said = f"the voltage was measured with {noise.max():.2g} V of noise"
    message = f"{said}, which was removed where the drive is smooth, because the stage has not seen it"
    return replace(experiment, records=records), (Notice(VOLTAGE_NOISE, message),)
