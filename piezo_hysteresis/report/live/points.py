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

"""Reduces many samples to points to draw: the extremes of every bin, and gaps where samples are missing."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray
from scipy.signal import find_peaks

from ..figures.thinning import thinned
from .sample_window import Window

Array = NDArray[np.float64]

LINE_POINTS = 1200
"""Points of a line over time."""

LOOP_POINTS = 1200
"""Points of a loop."""

CYCLES = 4
"""Cycles of the drive that are drawn as loops, the newest ones."""

_PROMINENCE = 0.05
"""Share of the span of the drive by which a trough must stand out to count as the end of a cycle."""


def extremes(values: Array, points: int = LINE_POINTS) -> NDArray[np.intp]:
    """Indices of finite samples to draw, with the smallest and largest of every bin and both sides of every gap.

    Parameters
    ----------
    values : (n,) ndarray
        Samples; NaN where there is none.
    points : int
        About how many indices to return.
    """
    finite = np.flatnonzero(np.isfinite(values))
    if finite.size == 0:
        return finite
    kept = finite[thinned(values[finite], points)]
    breaks = np.flatnonzero(np.diff(finite) > 1)
    return np.union1d(kept, np.concatenate((finite[breaks], finite[breaks + 1]))) if breaks.size else kept


def with_gaps(places: NDArray[np.intp], valid: NDArray[np.bool_], *columns: Array) -> list[Array]:
    """Columns at some places, with a NaN wherever samples between two of these places are missing.

    Parameters
    ----------
    places : (k,) ndarray of int
        Increasing indices.
    valid : (n,) ndarray of bool
        Which samples exist.
    *columns : (n,) ndarray
        Values to draw.
    """
    missing = np.concatenate(([0], np.cumsum(~valid)))
    after = 1 + np.flatnonzero(np.diff(missing[places]))
    return [np.insert(column[places], after, np.nan) for column in columns]


def padded(columns: Mapping[str, Array]) -> dict[str, Array]:
    """Columns of one length: the shorter ones end with NaN, which is not drawn."""
    longest = max(column.size for column in columns.values())
    return {name: np.pad(c, (0, longest - c.size), constant_values=np.nan) for name, c in columns.items()}


def followed(time: Array, longest: float) -> NDArray[np.bool_]:
    """Which samples are followed by the next one within `longest` [s]. A stalled driver jumps in time, not in number.

    Parameters
    ----------
    time : (n,) ndarray
        Time of every sample [s].
    longest : float
        Longest time to the next sample [s].
    """
    return ~(np.diff(time, append=time[-1:]) > longest)


def newest_cycles(window: Window) -> Window:
    """The last few cycles of the drive, or all of the window where it holds fewer.

    A window with very many cycles is halved before the search, so that the cycles stay distinguishable after thinning.
    """
    while window.size > 64:
        places = extremes(window.voltage)
        drive = window.voltage[places]
        span = float(np.ptp(drive)) if drive.size else 0.0
        if span == 0.0:
            return window
        troughs = find_peaks(-drive, prominence=_PROMINENCE * span)[0]
        if troughs.size <= LINE_POINTS // 20:
            return window.part(int(places[troughs[-CYCLES - 1]])) if troughs.size > CYCLES else window
        window = window.part(window.size // 2)
    return window


def loop_places(window: Window) -> NDArray[np.intp]:
    """Indices to draw of a loop: extremes of drive and displacement, and even steps in between."""
    even = np.flatnonzero(np.isfinite(window.displacement))[:: max(1, window.size // (LOOP_POINTS // 2))]
    return np.union1d(
        even,
        np.union1d(extremes(window.voltage, LOOP_POINTS // 4), extremes(window.displacement, LOOP_POINTS // 4)),
    )
