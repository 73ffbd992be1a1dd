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

"""Swings of a drive: the movements from one turning point to the next, and their shapes.

A swing is a half cosine, a straight line, or neither. Where the amplitude of a wave changes on the way through its
middle, a swing consists of two halves of different height.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...record import Samples
from ...turning_points import find_turns

COARSEST = 40_000
"""Largest number of samples in which turning points are searched one by one."""
OTHER, STRAIGHT, COSINE, UNSEEN = range(4)
"""Shapes of swings; `UNSEEN` stands for swings that are too short to have one."""
_POINTS = 24
"""Points of a swing that are compared with a shape."""
_SHORTEST = 12
"""Samples in the shortest swing whose shape is seen."""
_SAME_SHAPE = 0.025
"""Largest rms deviation from a shape, share of the swing; a line and a half cosine are 0.07 apart."""
_LARGEST_STEP = 6.0
"""Largest ratio of two amplitudes that follow one another in a growing or shrinking wave."""


def turning_points(voltage: Samples, least_swing: float) -> NDArray[np.int64]:
    """Positions of the first sample, of every reversal by at least `least_swing` [V], and of the last sample.

    The first swing begins at the first sample. Of a long drive only the smallest and the largest value of every block
    are examined, because a recording is read without the compiler.
    """
    if voltage.size > COARSEST:
        length = 2 * voltage.size // COARSEST
        blocks = voltage[: voltage.size // length * length].reshape(-1, length)
        extremes = np.stack((blocks.argmin(axis=1), blocks.argmax(axis=1)), axis=1)
        extremes.sort(axis=1)
        inner = (extremes + length * np.arange(len(blocks))[:, None]).ravel()
        positions = np.concatenate(([0], inner, [voltage.size - 1]))
    else:
        positions = np.arange(voltage.size)
    turns = np.zeros(positions.size, np.int64)
    more_than = np.nextafter(least_swing, 0.0)
    count = find_turns(voltage[positions].tolist(), more_than, True, turns)
    return np.concatenate(([0], positions[turns[:count]], [voltage.size - 1]))


def swing_shapes(voltage: Samples, turns: NDArray[np.int64]) -> NDArray[np.int8]:
    """Shape of every swing between the positions `turns`.

    Both halves of a swing may be of different height.
    """
    size = np.diff(turns)
    share = np.linspace(0.0, 1.0, _POINTS + 1)
    at = turns[:-1, None] + share * size[:, None]
    before = np.minimum(at.astype(np.int64), voltage.size - 2)
    values = voltage[before] + (at - before) * (voltage[before + 1] - voltage[before])
    height = values[:, -1:] - values[:, :1]
    way = (values - values[:, :1]) / np.where(height == 0.0, 1.0, height)
    least = 1.0 / (1.0 + _LARGEST_STEP)
    middle = np.clip(way[:, _POINTS // 2, None], least, 1.0 - least)
    late = share > 0.5
    shapes = np.zeros(size.size, np.int8)
    for shape, ideal in ((STRAIGHT, share), (COSINE, 0.5 - 0.5 * np.cos(np.pi * share))):
        halves = 2.0 * np.where(late, middle + (1.0 - middle) * ideal - 0.5, middle * ideal)
        shapes[np.sqrt(np.mean((way - halves) ** 2, axis=1)) < _SAME_SHAPE] = shape
    shapes[size < max(_SHORTEST, 3 * (2 * voltage.size // COARSEST))] = UNSEEN
    return shapes
