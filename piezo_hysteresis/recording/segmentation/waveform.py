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

"""Name of a drive signal, found from its shape: sine, triangle, chirp, multisine, noise, step, ramp, rest."""

from __future__ import annotations

import itertools

import numpy as np
from numpy.typing import NDArray

from ...record import Samples
from .swing_shapes import COARSEST, COSINE, STRAIGHT, swing_shapes, turning_points

_LEAST_SWING = 0.05
"""Least swing of a turning point, share of the range."""
_REGULAR = 0.1
"""Relative difference up to which two periods are alike."""
_STRAIGHT = 0.03
"""Largest rms deviation of a straight swing, share of the swing."""
_RESOLVED = 3
"""Fewest sample periods of a usual swing that can be told from a straight line."""
_EDGE, _STRAIGHT_EDGE, _LONG_EDGE = 0.05, 0.01, 8
"""Both ends of a swing that may be held levels, largest deviation between them, shares of the swing; fewest samples."""
_MAJORITY = 0.8
"""Share of the whole swings that have the shape of a wave which grows or shrinks."""
_FEWEST = 4
"""Fewest whole swings that show a wave which grows or shrinks."""
_OTHER_POWER = 0.005
"""Largest share of the power outside a sine."""
_PERIODIC = 0.9
"""Autocorrelation from which a drive repeats itself."""
_STILL = 0.01
"""Largest median step of a drive that consists of levels, as a share of its range."""
_UNCERTAIN = 0.05
"""Uncertainty of the frequency of a sine, in cycles over its whole duration; in 95 % of the cases it is smaller."""


def phase_name(voltage: Samples, sample_period: float) -> str:
    """Propose the phase name of a drive signal without pauses.

    A swing is the movement from one turning point to the next. Straight swings make a triangle, straight ones between
    held levels a trapezoid, and swings of equal duration with periods that a sine fits a sine; other periodic drives
    are a multisine, and all others are noise.

    Parameters
    ----------
    voltage : (n,) ndarray
        Drive [V].
    sample_period : float
        Time between samples [s].

    Returns
    -------
    str
        One of rest, step, ramp, steps, chirp, triangle, minor_loops, trapezoid, ``sine_<f>hz``, multisine, noise.

    Examples
    --------
    >>> t = np.arange(4000) * 1e-3
    >>> phase_name(np.sin(2 * np.pi * 5 * t), 1e-3), phase_name(np.abs(t % 1 - 0.5), 1e-3)
    ('sine_5hz', 'triangle')
    """
    span = float(np.ptp(voltage))
    if span <= 1e-9 * float(np.abs(voltage).max()):
        return "rest"
    turns = turning_points(voltage, _LEAST_SWING * span)
    if turns.size <= 2:
        return _transition(voltage)
    wave = voltage[turns[1] : turns[-2] + 1]  # without the motion before and after it
    if _has_levels(wave):
        return "steps"
    if _is_chirp(wave):
        return "chirp"
    if np.median(np.diff(turns)) < 8 * (voltage.size // COARSEST):  # too fast for the coarse turning points
        middle = wave.size // 2
        voltage = wave[max(0, middle - COARSEST // 2) : middle + COARSEST // 2]
        turns = turning_points(voltage, _LEAST_SWING * span)
    straight = _straightness(voltage, turns)
    reversals = turns[1:-1]  # the ends of the record are no turning points
    periods = reversals[2:] - reversals[:-2]
    swings = np.diff(reversals if reversals.size > 1 else turns)  # those of the ends may be parts of swings
    usual = float(np.median(periods)) if periods.size else 2.0 * float(swings[0])
    like = periods[np.abs(periods - usual) <= _REGULAR * usual]
    regular = like.size >= 0.8 * periods.size - 1  # one may belong to the motion before or after
    if straight < _STRAIGHT and (regular or np.median(np.diff(turns)) >= _RESOLVED):
        return "triangle" if regular else "minor_loops"
    shapes = swing_shapes(voltage, turns)[1:-1]
    if regular and np.count_nonzero(shapes == STRAIGHT) >= max(_FEWEST, _MAJORITY * shapes.size):
        return "triangle"
    if _has_straight_edges(voltage, turns):
        return "trapezoid"
    period = float(np.mean(like)) if like.size else usual
    body = voltage[turns[0] if turns.size <= 3 else turns[1] :]
    cosines = np.count_nonzero(shapes == COSINE) >= max(_FEWEST, _MAJORITY * shapes.size)
    if regular and (cosines or _is_sine(body, period)):
        duration = body.size * sample_period
        return sine_name(_frequency(body, 1 / period) / sample_period, _UNCERTAIN / duration)
    return "multisine" if _repeats(wave) else "noise"


def sine_name(frequency: float, uncertainty: float) -> str:
    """Phase name of a sine: its frequency [Hz] with the fewest digits within the uncertainty [Hz], at most three.

    >>> sine_name(9.99, 0.02), sine_name(9.99, 0.002), sine_name(12345.0, 1.0)
    ('sine_10hz', 'sine_9.99hz', 'sine_12300hz')
    """
    rounded = [float(f"{frequency:.{digits}g}") for digits in (1, 2, 3)]
    named = next((f for f in rounded if abs(f - frequency) <= uncertainty), rounded[-1])
    return f"sine_{np.format_float_positional(named, trim='-')}hz"


def _transition(voltage: Samples) -> str:
    """Step or ramp, by the time that the middle four fifths of the way take."""
    way = np.abs(voltage - voltage[0]) / np.ptp(voltage)
    moving = np.count_nonzero((way > 0.1) & (way < 0.9))
    return "step" if moving <= max(2, voltage.size // 20) else "ramp"


def _has_levels(voltage: Samples) -> bool:
    """True where the drive stays at one of a few voltages; a sine of few samples per period visits as few."""
    if voltage.size < 3 or np.median(np.abs(np.diff(voltage))) > _STILL * float(np.ptp(voltage)):
        return False
    place = (voltage - voltage.min()) / (float(np.ptp(voltage)) or 1.0)
    counts = np.sort(np.bincount((200 * place).astype(np.intp), minlength=201))
    return bool(counts[-8:].sum() > 0.7 * voltage.size and counts[-1] < 0.8 * voltage.size)


def _straightness(voltage: Samples, turns: NDArray[np.int64]) -> float:
    """Deviation of the swings from straight lines: rms relative to the swing, median over swings."""
    swings = list(itertools.pairwise(turns.tolist()))
    whole = swings[1:-1] or swings
    deviations = [1.0]
    for a, b in whole[:: max(1, len(whole) // 200)]:
        if voltage[b] != voltage[a]:
            way = (voltage[a : b + 1] - voltage[a]) / (voltage[b] - voltage[a])
            deviations.append(float(np.sqrt(np.mean((way - np.linspace(0.0, 1.0, b - a + 1)) ** 2))))
    return float(np.median(deviations[1:] or deviations))


def _has_straight_edges(voltage: Samples, turns: NDArray[np.int64]) -> bool:
    """True where the swings are straight apart from their ends, where the drive may be held."""
    swings = list(itertools.pairwise(turns.tolist()))
    deviations = []
    for a, b in swings[:: max(1, len(swings) // 200)]:
        way = (voltage[a : b + 1] - voltage[a]) / ((voltage[b] - voltage[a]) or 1.0)
        edge = way[(way > _EDGE) & (way < 1.0 - _EDGE)]
        if edge.size < _LONG_EDGE:
            return False
        deviations.append(float(np.sqrt(np.mean((edge - np.linspace(edge[0], edge[-1], edge.size)) ** 2))))
    return float(np.median(deviations)) < _STRAIGHT_EDGE


def _is_sine(voltage: Samples, period: float) -> bool:
    """True where single periods are sines of any amplitude and level; `period` in samples."""
    length = max(3, round(period))
    starts = np.arange(0, voltage.size - length, max(length, voltage.size // 200))
    if not starts.size:
        starts, length = np.array([0]), voltage.size
    angle = 2.0 * np.pi * np.arange(length) / period
    basis, _ = np.linalg.qr(np.stack((np.ones(length), np.sin(angle), np.cos(angle), np.arange(length)), axis=1))
    shares = []
    for start in starts.tolist():
        part = voltage[start : start + length] - voltage[start : start + length].mean()
        left = part - basis @ (basis.T @ part)
        shares.append(float(left @ left) / (float(part @ part) or 1.0))
    return float(np.median(shares)) < _OTHER_POWER


def _frequency(voltage: Samples, start: float) -> float:
    """Frequency of a sine [1/sample], from the phase difference between two halves of the record."""
    half = voltage.size // 2
    if half * start < 1.0:
        return start
    frequency = start
    for _ in range(2):
        window = np.hanning(half) * np.exp(-2j * np.pi * frequency * np.arange(half))
        first, second = ((part - part.mean()) @ window for part in (voltage[:half], voltage[half : 2 * half]))
        turn = np.angle(second * np.conj(first) * np.exp(-2j * np.pi * frequency * half))
        frequency += float(turn) / (2.0 * np.pi * half)
    return frequency if abs(frequency / start - 1.0) < _REGULAR else start


def _is_chirp(voltage: Samples) -> bool:
    """True where the rate of mean crossings grows or falls steadily by at least three times."""
    parts = 8
    if voltage.size < 32 * parts:
        return False
    blocks = voltage[: voltage.size // parts * parts].reshape(parts, -1)
    crossings = np.array([_crossings(block) for block in blocks], float)
    if crossings[0] > crossings[-1]:
        crossings = crossings[::-1]
    steady = np.all(np.diff(crossings) >= -1) and np.count_nonzero(np.diff(crossings) > 0) >= parts - 3
    return bool(steady and crossings[-1] >= 3 * max(crossings[0], 1.0) and crossings[-1] >= 8)


def _crossings(voltage: Samples) -> int:
    centred = voltage - voltage.mean()
    away = np.sign(centred[np.abs(centred) > 0.2 * centred.std()])
    return int(np.count_nonzero(np.diff(away)))


def _repeats(voltage: Samples) -> bool:
    """True where the autocorrelation returns to a high value, for odd multisines also with the opposite sign."""
    x = voltage[: 1 << 20] - voltage[: 1 << 20].mean()
    size = 1 << (2 * x.size - 1).bit_length()
    overlap = np.fft.irfft(np.abs(np.fft.rfft(x, size)) ** 2, size)[: x.size // 2 + 1]
    energy = np.cumsum(x**2)
    lags = np.arange(overlap.size)
    head = energy[x.size - 1 - lags]
    tail = energy[-1] - np.concatenate(([0.0], energy))[lags]
    similarity = np.abs(overlap) / np.sqrt(np.maximum(head * tail, 1e-12 * energy[-1] ** 2 + 1e-300))
    first = np.flatnonzero(similarity < 0.5)
    return bool(first.size and similarity[first[0] :].max() > _PERIODIC)
