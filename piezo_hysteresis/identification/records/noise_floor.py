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

"""The floor of every record: the smallest RMS residual in which an effect can be seen, at the record's sample period.

It is the largest of four values: white noise from the top of the spectrum, where a stage does not move; the scatter
between periods of a periodic record, which includes jitter and 1/f noise; the resolution of the converter, q/√12; and
an adequacy floor of 0.03 % of the range, below which a model is good enough for any laboratory. If the voltage was
measured, the model follows its noise, which the stage has not seen; times the gain of the stage, it adds to the noise.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy

from ...blocks.block import Array
from ...channel_mapping import quantity_of
from ...effects.extent import MAINS
from ...record import Experiment, Record
from ..fit.form_uncertainty import ADEQUACY
from .noise import noise_on_motion, travel
from .once import once_per_record

ADEQUATE = 1.5
"""Mean squared ratio of residual to floor up to which nothing is missing beyond noise."""
ALIKE, UNLIKE = 1e-6, 0.1
"""Shares of the drive power: largest difference after one period, and smallest difference in between."""
FASTEST = 3
"""Number of fastest periodic records from which jitter is estimated; the smallest of their estimates is used."""
UNUSUAL = 2.0
"""Ratio of the scatter of a record to the value expected from the others from which the stage counts as not settled."""
TOP_BAND = 0.7
"""Share of the Nyquist frequency above which a record contains only noise."""
SHORT = 32
"""Samples of a short window: the longest between the turns of a fast drive, the shortest in which ringing is a peak."""
CHANCE = 2.0
"""Relative differences, times √n, up to which the noise of short windows is the same as that of a whole record."""
SHOWN = 5.0
"""Relative excess of the scatter over the white noise, times √n, up to which chance explains it (two standard errors).
"""


def stroke(records: Sequence[Record]) -> float:
    """Range of the displacement over all records [m], to which all percentages refer."""
    return Experiment(tuple(records)).range


@once_per_record
def white_noise(record: Record) -> float:
    """RMS of the white noise of a record [m], from the median of its spectrum near the Nyquist frequency.

    Fast motion is in all samples but not near the Nyquist frequency. Jumps, turns and the ringing that they start are
    at all frequencies of a record, but in few of its short windows. Fewer than 32 samples have no such spectrum: their
    noise is that of third differences, in which motion is small. 0 for fewer than eight samples, which do not show it.
    """
    if record.size < 8:
        return 0.0
    beside_motion = noise_on_motion(record.displacement, 3)
    if record.size < SHORT:
        return beside_motion
    second = np.diff(record.displacement, 2)
    at_top, between_jumps = _at_top(second, second.size, "hann"), _at_top(second, SHORT, "blackmanharris")
    return min(at_top, beside_motion, (1.0 + CHANCE / np.sqrt(second.size)) * between_jumps)


def _at_top(second: Array, size: int, window: str) -> float:
    """White noise of which these are the second differences [m], from the spectra of all windows of so many samples."""
    size = min(size, second.size)
    options = {"window": window, "nperseg": size, "noverlap": size - size // 4, "detrend": False}
    frequency, _, density = scipy.signal.spectrogram(second, **options)
    top = slice(int(TOP_BAND * frequency.size), -1)
    flat = density[top] / ((2.0 * np.sin(np.pi * frequency[top])) ** 4)[:, None]
    # values of a spectrum have an exponential distribution, whose median is ln 2 times its mean
    return float(np.sqrt(np.median(flat) / np.log(2.0) / 2.0))


@once_per_record
def period_scatter(record: Record) -> float | None:
    """RMS of the part that does not repeat from one drive period to the next [m]; None for fewer than three periods.

    The first period is left out, because the stage settles in it. Mains hum is removed, because it is an effect; so are
    peaks of the spectrum, such as a ringing resonance or a drift.
    """
    period = drive_period(record.voltage)
    if period is None or record.size < 3 * period:
        return None
    first = period if record.size < 7 * period else period * ((record.size // period - 1) // 2)
    return min(_scatter(record, period, period), _scatter(record, period, first))


def _scatter(record: Record, period: int, first: int) -> float:
    """Scatter from the sample `first` on, because a stage may still ring after its drive has become periodic."""
    y = record.displacement[first:]
    steps = y[period:] - y[:-period]
    # a period that is not a whole number of samples leaves a part of the drive; other axes need not be periodic
    rest = record.voltage[first + period :] - record.voltage[first:-period]
    others = [values for name, values in record.channels.items() if quantity_of(name) == "displacement"]
    seen = [other[first + period :] - other[first:-period] for other in others]
    t = record.sample_period * np.arange(steps.size)
    lines = [f for base in MAINS for f in (base, 2 * base, 3 * base) if f * record.sample_period < 0.45]
    hum = [wave(2 * np.pi * f * t) for f in lines for wave in (np.cos, np.sin)]
    beside = [np.ones(t.size), rest, np.gradient(rest), *seen]
    # waves of constant size that are fitted to ringing leave peaks at all lines, and these fill a short spectrum
    without_hum = _broad(steps, [*beside, *hum], "hann", period)
    return min(without_hum, _broad(steps, beside, "blackmanharris", period))


def _broad(steps: Array, known: Sequence[Array], taper: str, period: int) -> float:
    """RMS of the noise of one period in differences of two [m], beside `known` signals and peaks of the spectrum."""
    basis = np.array(known)
    steps = steps - np.linalg.lstsq(basis.T, steps, rcond=1e-6)[0] @ basis
    window = scipy.signal.windows.get_window(taper, steps.size, fftbins=False)
    frequency, density = scipy.signal.periodogram(steps, window=window, detrend=False)
    # the difference of two periods is a comb filter: white noise gets this mean spectrum, with twice its variance
    alike = window[period:] @ window[:-period] / (window @ window) if steps.size > period else 0.0
    comb = 1.0 - alike * np.cos(2.0 * np.pi * frequency * period)
    noise = np.where(comb > 0.2, density / np.maximum(comb, 0.2), np.nan)
    return float(np.sqrt(_sum_of_octaves(noise) / steps.size / 2.0))


def _sum_of_octaves(density: Array) -> float:
    """Sum of a spectrum from the medians of its octaves, without dc, so that narrow peaks are ignored."""
    edges = [1]
    while edges[-1] < density.size:
        edges.append(min(max(2 * edges[-1], edges[-1] + 8), density.size))
    bands = [density[a:b] for a, b in zip(edges, edges[1:], strict=False)]
    return float(sum(b.size * np.nanmedian(b) for b in bands if np.isfinite(b).any()) / np.log(2.0))


@once_per_record
def quantum(record: Record) -> float:
    """Resolution of the converter [m]: the smallest difference between readings; 0 if readings do not repeat."""
    levels = np.unique(record.displacement)
    return float(np.diff(levels).min()) if 1 < levels.size <= record.size // 2 else 0.0


def drive_period(voltage: Array) -> int | None:
    """Shortest exact period of a drive with at least two periods [samples]; None if it is not periodic.

    Neighbouring samples of a slow drive are similar too, so the drive must first differ from itself before it repeats.
    """
    moving = voltage - voltage.mean()
    if moving @ moving == 0.0:
        return None
    product = scipy.signal.correlate(moving, moving, method="fft")[voltage.size - 1 :][: voltage.size // 2 + 1]
    energy = np.concatenate(([0.0], np.cumsum(moving * moving)))
    lags = np.arange(product.size)
    overlap = energy[voltage.size - lags] + (energy[-1] - energy[lags])
    mismatch = (overlap - 2.0 * product) / np.maximum(overlap, 1e-300)
    unlike = int(np.argmax(mismatch > UNLIKE))
    (alike,) = np.nonzero(mismatch[unlike:] < ALIKE)
    if not (unlike and alike.size):
        return None
    first = unlike + int(alike[0])
    beyond = np.flatnonzero(mismatch[first:] >= ALIKE)
    run = mismatch[first : first + int(beyond[0])] if beyond.size else mismatch[first:]
    return first + int(np.argmin(run))


def noise_floors(records: Sequence[Record]) -> Array:
    """Noise of every record at its own sample period [m], shape (r,), without the adequacy floor.

    Scatter between periods is the sum of white noise, slower noise in proportion to it, and jitter of the clock in
    proportion to the speed. Records without periods use the estimates of the periodic ones.
    """
    drive = max(map(travel, records))
    followed = np.array([r.voltage_noise for r in records]) * (stroke(records) / drive if drive > 0.0 else 0.0)
    return np.hypot(_sensor_noise(records), followed)


def _sensor_noise(records: Sequence[Record]) -> Array:
    """Noise of the displacement of every record [m], shape (r,)."""
    white = np.array([max(white_noise(r), quantum(r) / np.sqrt(12.0)) for r in records])
    speed = np.array([_speed(r, w) for r, w in zip(records, white, strict=True)])
    scatter = np.array([np.nan if (s := period_scatter(r)) is None else s for r in records])
    (periodic,) = np.nonzero(np.isfinite(scatter) & (white > 0.0))
    if not periodic.size:
        return white
    by_chance = (1.0 + SHOWN / np.sqrt([r.size for r in records])) * white
    beyond = np.sqrt(np.maximum(scatter**2 - by_chance**2, 0.0))  # of a slow record, it counts more in fast ones
    fastest = [i for i in periodic[np.argsort(-speed[periodic])][:FASTEST] if speed[i] > 0.0]
    jitter = min((beyond[i] / speed[i] for i in fastest), default=0.0)
    excess = [np.sqrt(max(1.0, (scatter[i] ** 2 - (jitter * speed[i]) ** 2) / white[i] ** 2)) for i in periodic]
    expected = np.hypot(white * float(np.median(excess)), jitter * speed)
    return np.where(np.isfinite(scatter), np.clip(scatter, white, UNUSUAL * expected), expected)


def noise_of_averages(noise: Array, before: Sequence[Record], after: Sequence[Record]) -> Array:
    """Noise of records of which some were averaged [m], shape (r,); that of averages is estimated anew, from them.

    `noise` is that of the records `before` [m]; the averages are the records of `after` with a longer sample period.
    """
    averaged = [a.sample_period > 1.001 * b.sample_period for a, b in zip(after, before, strict=True)]
    return np.where(averaged, np.minimum(noise, noise_floors(after)), noise) if any(averaged) else noise


def _speed(record: Record, noise: float) -> float:
    """RMS speed of the stage without the noise of the sensor [m/s]."""
    if record.size < 3:
        return 0.0
    steps = np.diff(record.displacement)
    return float(np.sqrt(max(0.0, float(np.mean(steps**2)) - 2.0 * noise**2))) / record.sample_period


def floors(records: Sequence[Record], noise: Array | None = None) -> Array:
    """Floor of every record [m], shape (r,): the larger of its noise, which can be given, and the adequacy floor."""
    return np.maximum(noise_floors(records) if noise is None else noise, ADEQUACY * stroke(records))
