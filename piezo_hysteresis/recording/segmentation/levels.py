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

"""Levels of a drive signal, and the movements between them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...record import Samples
from .swing_shapes import turning_points

LARGEST_NOISE = 0.02
"""Voltages within this share of the range are one level."""

_BLOCKS = 20_000
"""Approximate number of blocks into which the drive is cut."""
_SHORTEST = 4
"""Smallest number of samples in a block."""
_NOISE_WIDTH = 20.0
"""Noise widths within which voltages are one level."""
_PEAK = 0.5
"""Length of a level over that of the shorter movement beside it, below which it is the top of a wave."""
_CURVED = 0.25
"""Difference between the means of both halves of a level, as a share of its range: 0.5 for a parabola, 0 for noise."""


@dataclass(frozen=True, slots=True)
class Piece:
    """A level or a movement. A jump between two levels is a movement without samples."""

    start: int
    stop: int
    level: float = np.nan  # NaN where the drive moves

    @property
    def moves(self) -> bool:
        return self.level != self.level

    @property
    def size(self) -> int:
        return self.stop - self.start


def pieces_of(voltage: Samples) -> list[Piece]:
    """Movements and levels in turn, from the first sample to the last; the flat tops of a wave belong to the wave."""
    span = float(np.ptp(voltage))
    if span <= 1e-9 * float(np.abs(voltage).max()):
        return [Piece(0, voltage.size, float(voltage[0]))]
    length = max(_SHORTEST, voltage.size // _BLOCKS)
    noise = float(np.quantile(np.std(_blocks(voltage, 4 * length), axis=1), 0.01))
    tolerance = min(max(_NOISE_WIDTH * noise, 1e-6 * span), LARGEST_NOISE * span)
    length = max(length, int(voltage.size * tolerance / span))  # the slowest drive passes its range once
    levels = _joined(voltage, _levels_of(voltage, _blocks(voltage, length), length, tolerance), 4 * tolerance)
    turns = turning_points(voltage, max(4 * tolerance, 0.01 * span))
    levels = _without_peaks(levels, turns, voltage)
    pieces: list[Piece] = []
    end = 0
    for level in levels:
        if level.start > 0:
            pieces.append(Piece(end, level.start))  # empty where the drive jumps
        pieces.append(level)
        end = level.stop
    if end < voltage.size:
        pieces.append(
            Piece(
                end,
                voltage.size,
            )
        )
    return pieces


def _blocks(voltage: Samples, length: int) -> Samples:
    if voltage.size < length:
        return voltage[None, :]
    return voltage[: voltage.size // length * length].reshape(-1, length)


def _levels_of(voltage: Samples, blocks: Samples, length: int, tolerance: float) -> list[Piece]:
    """Runs of blocks that stay within the tolerance, extended to the sample."""
    lows, highs = blocks.min(axis=1).tolist(), blocks.max(axis=1).tolist()
    found: list[Piece] = []
    k = 0
    while k < len(lows):
        low, high, first = lows[k], highs[k], k
        while k + 1 < len(lows) and max(high, highs[k + 1]) - min(low, lows[k + 1]) <= tolerance:
            k += 1
            low, high = min(low, lows[k]), max(high, highs[k])
        k += 1
        if high - low > tolerance or k - first < 2:
            continue
        start, stop = first * length, min(k * length, voltage.size)
        middle = (low + high) / 2
        previous = found[-1].stop if found else 0
        before = np.abs(voltage[max(previous, start - length) : start][::-1] - middle) > tolerance
        after = np.abs(voltage[stop : stop + 2 * length] - middle) > tolerance
        start -= int(before.argmax()) if before.any() else before.size
        stop += int(after.argmax()) if after.any() else after.size
        found.append(Piece(start, stop, float(voltage[start:stop].mean())))
        k = max(k, -(-stop // length))
    return found


def _joined(voltage: Samples, levels: list[Piece], tolerance: float) -> list[Piece]:
    """Merge levels that follow one another, as on the flat top of a wave."""
    joined: list[Piece] = []
    for level in levels:
        if joined and float(np.ptp(voltage[joined[-1].stop - 1 : level.start + 1])) <= tolerance:
            start = joined.pop().start
            joined.append(Piece(start, level.stop, float(voltage[start : level.stop].mean())))
        else:
            joined.append(level)
    return joined


def _without_peaks(levels: list[Piece], turns: NDArray[np.int64], voltage: Samples) -> list[Piece]:
    """Levels that are not short against the movements beside them, up to the next level or turning point.

    At an end of the record only one movement is known, so that there a short level is a wave only if it is curved.
    """
    kept = []
    size = voltage.size
    for i, level in enumerate(levels):
        before = max(int(turns[turns < level.start - 1].max(initial=0)), levels[i - 1].stop if i else 0)
        after = min(
            int(turns[turns > level.stop].min(initial=size)), levels[i + 1].start if i + 1 < len(levels) else size
        )
        # the length of a movement at the end of the record is unknown
        moves = [level.start - before] * (before > 0) + [after - level.stop] * (after < size - 1)
        is_long = level.size >= _PEAK * min(moves, default=0)
        at_end = level.start == 0 or level.stop == size
        if is_long or (at_end and not _is_curved(voltage[level.start : level.stop])):
            kept.append(level)
    return kept


def _is_curved(level: Samples) -> bool:
    """Whether the drive moves all the time, as at the top of a wave; a rest with noise does not."""
    halves = level[: level.size // 2], level[level.size // 2 :]
    return bool(abs(halves[0].mean() - halves[1].mean()) > _CURVED * np.ptp(level))
