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

"""Swapped channels: the recorded voltage follows the recorded displacement.

Two facts of every stage decide. A loop of the displacement against the drive is passed counter-clockwise, because
hysteresis, creep and every filter make the displacement late. And as long as the gain has not changed, the phase falls
with the frequency.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...record import Notice, Record, Samples
from ..segmentation.swing_shapes import turning_points

_SWING = 0.2
"""Least swing of a turning point, share of the range."""
_FEWEST_SWINGS, _SHORTEST = 3, 16
"""Fewest swings, and samples of a usual one, that show the direction of a loop."""
_POINTS = 24
"""Points of every swing."""
_MOST_SWINGS = 200
"""Largest number of swings that are used."""
_OPENING = -0.03
"""Opening from which a loop is passed the wrong way; charge amplifiers leave a narrower one."""
_ONE_LOOP = 0.97
"""Share of the variance that a loop must explain."""
_SURE = 6.0
"""Standard errors by which a result must differ from zero."""
_HALF_LAG, _WHOLE_LAG = 16e-3, 4e-3
"""Lags [s] that no stage has.

A lead cannot be told from a lag that is longer by one period, which occurs behind two resonances. If the displacement
falls when the drive rises, half a period is enough, which occurs behind one resonance.
"""
_SEGMENTS, _LONGEST, _LEAST = 6, 4096, 128
"""Segments of a record for its frequency response at least, and largest and smallest number of samples of one."""
_MOST_SEGMENTS = 128
"""Largest number of segments that are used."""
_COHERENT = 0.9
"""Coherence from which a frequency counts."""
_FAINT = 1e-5
"""Power of a frequency that does not count, share of the largest."""
_FEWEST_LINES, _WIDEST_GAP, _BAND = 16, 8, 3.0
"""Fewest frequencies of a response, widest gap between two [lines], and least ratio of the last to the first."""
_SAME_GAIN = 2.0
"""Ratio by which the gain may differ from that at low frequencies; at a zero of a response the phase may rise."""
_RISE = np.radians(20.0)
"""Rise of the phase over the band, and phase at its end, from which the displacement leads [rad]."""
_SAMPLES = 1.5
"""Least lead [samples]; channels that are sampled one after the other differ by up to one."""


def swapped(record: Record) -> Notice | None:
    """Severe notice ``leads`` where the drive follows the displacement; None where that is not sure.

    Parameters
    ----------
    record : Record
    """
    opening = loop_opening(record)
    if opening is not None and opening < _OPENING:
        text = (
            f"the loop is passed clockwise, {-100.0 * opening:.2g} % wide: the displacement leads the voltage; "
            "both channels are swapped, or one is shifted"
        )
        return Notice("leads", text, record.phase, severe=True)
    lead = lead_in_band(record)
    if lead is not None and lead > _SAMPLES * record.sample_period:
        text = (
            f"the displacement leads the voltage by {lead:.3g} s ({lead / record.sample_period:.2g} samples) over a "
            "band of frequencies; both channels are swapped, or one is shifted"
        )
        return Notice("leads", text, record.phase, severe=True)
    return None


def loop_opening(record: Record) -> float | None:
    """Width of the loops as a share of the swings; negative where they are passed clockwise.

    Between two turns of the drive, the displacement is a function of the drive, and a parabola for every direction that
    vanishes at the turns. None where no such loop describes the record, or where a long lag has the same loop.
    """
    u, y = record.voltage, record.displacement
    span = float(np.ptp(u))
    if span == 0.0:
        return None
    turns = turning_points(u, _SWING * span)[1:-1]  # what comes before and after may be no swing
    start, end = turns[:-1], turns[1:]
    if start.size < _FEWEST_SWINGS:
        return None
    length = float(np.median(end - start))
    if length < _SHORTEST:
        return None
    chosen = slice(None, None, -(-start.size // _MOST_SWINGS))
    start, end = start[chosen], end[chosen]
    share = (np.arange(_POINTS) + 0.5) / _POINTS
    at = np.rint(start[:, None] + share * (end - start)[:, None]).astype(np.int64)
    height = (u[end] - u[start])[:, None]
    way = 2.0 * (u[at] - u[start][:, None]) / height - 1.0
    loops = 0.5 * height * np.clip(1.0 - way**2, 0.0, 1.0) / span
    drive = (u[at] - u.mean()) / span
    basis = np.stack((np.ones(at.shape), at / u.size, drive, drive**2, drive**3, loops), axis=-1).reshape(-1, 6)
    measured = y[at].ravel()
    found, *_ = np.linalg.lstsq(basis, measured, rcond=None)
    left = float(np.var(measured - basis @ found))
    if found[2] == 0.0 or left > (1.0 - _ONE_LOOP) * float(np.var(measured)):
        return None
    # the points of a swing deviate together
    error = np.sqrt(left * _POINTS * np.linalg.pinv(basis.T @ basis)[5, 5])
    if abs(found[5]) <= _SURE * error:
        return None
    opening = -float(found[5] / found[2])
    swings, longest = (2.0, _WHOLE_LAG) if found[2] > 0.0 else (1.0, _HALF_LAG)
    lag = (swings + np.arctan(opening) / np.pi) * length * record.sample_period
    return opening if lag > longest else None


def lead_in_band(record: Record) -> float | None:
    """Lead of the displacement [s] by the phase over a band of frequencies; None if it does not lead, or is unsure."""
    response = _response(record)
    if response is None:
        return None
    lines, gain, variance = response
    phase = np.unwrap(np.angle(gain))
    if np.abs(np.diff(phase)).max() > 0.5 * np.pi:
        return None  # noise, or a resonance between two lines
    phase -= np.pi * np.rint(phase[0] / np.pi)  # the polarity does not matter
    quarter = lines.size // 4
    low, high = slice(quarter), slice(-quarter, None)
    first, last = (float(np.average(phase[part], weights=1.0 / variance[part])) for part in (low, high))
    if min(last - first, last) < _RISE:
        return None
    weight = 1.0 / np.sqrt(variance)
    basis = np.stack((np.ones(lines.size), lines), axis=1) * weight[:, None]
    found, *_ = np.linalg.lstsq(basis, phase * weight, rcond=None)
    left = float(np.mean((phase * weight - basis @ found) ** 2))
    error = np.sqrt(left * np.linalg.inv(basis.T @ basis)[1, 1])
    return float(found[1]) if found[1] > _SURE * error else None


def _response(record: Record) -> tuple[Samples, NDArray[np.complex128], Samples] | None:
    """Angular frequencies [rad/s], complex gains and variances of their phases, up to where the gain changes."""
    length = min(_LONGEST, 1 << max(int(np.log2(max(record.size, 2) / _SEGMENTS)), 0))
    if length < _LEAST:
        return None
    starts = np.arange(0, record.size - length + 1, length // 2)[:_MOST_SEGMENTS]
    at = starts[:, None] + np.arange(length)
    window = np.hanning(length)
    u, y = (
        np.fft.rfft((x[at] - x[at].mean(axis=1, keepdims=True)) * window, axis=1)
        for x in (record.voltage, record.displacement)
    )
    of_u, of_y = (np.mean(np.abs(x) ** 2, axis=0) for x in (u, y))
    both = np.mean(y * u.conj(), axis=0)
    coherence = np.abs(both) ** 2 / np.maximum(of_u * of_y, np.finfo(float).tiny)
    counts = coherence > _COHERENT
    for power in (of_u, of_y):
        counts &= power > _FAINT * power[2:].max()
    lines = np.flatnonzero(counts[2:]) + 2  # the first two contain the mean
    if lines.size < _FEWEST_LINES:
        return None
    lines = lines[: np.argmax(np.diff(lines, append=lines[-1:] + length) > _WIDEST_GAP) + 1]
    if lines.size < _FEWEST_LINES:
        return None
    gain = both[lines] / of_u[lines]
    level = float(np.median(np.abs(gain[: _FEWEST_LINES // 2])))
    changed = np.abs(np.log(np.abs(gain) / level)) > np.log(_SAME_GAIN)
    end = int(np.argmax(changed)) if changed.any() else lines.size
    if end < _FEWEST_LINES or lines[end - 1] < _BAND * lines[0]:
        return None
    variance: Samples = (1.0 - coherence[lines]) / (2.0 * starts.size * coherence[lines]) + 1e-6
    angular = np.asarray(2.0 * np.pi * lines / (length * record.sample_period), float)
    return angular[:end], gain[:end], variance[:end]
