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

"""`filled`: interpolates short gaps in smooth channels, where the samples around them show that this is accurate.

The state of the stage then continues, as the voltage did in the gap.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from ...record import Samples

LONGEST, LONGEST_SHARE = 1000, 1 / 64
"""Length of the longest gap that is filled, in samples and as a share of the phase."""
MOST = 10_000
"""Largest number of gaps that are examined."""
ERROR = 0.001
"""Largest error of the interpolation of measured samples around a gap, as a share of the range of the channel."""
NOISE_WIDTH, MOST_NOISE = 5.0, 0.01
"""Noise that the error may contain, in standard deviations, and its largest share of the range."""
FEWEST_TESTED = 8
"""Samples on either side of a gap by which the interpolation is tested, if there are as many."""
LARGEST_STEP = 2.0
"""Largest change of a channel over a gap, in units of its change over the same time before or after."""
LARGEST_CORNER = 4.0
"""Largest change before and after a turning point in a gap, in units of the error that is allowed."""

Gap = tuple[int, int]
"""First sample of a gap and first sample after it."""


def with_missing_rows(
    channels: Mapping[str, Samples], breaks: Mapping[int, int], pauses: Mapping[int, int]
) -> tuple[dict[str, Samples], dict[int, int], dict[int, int]]:
    """Channels with NaN in place of samples that are missing in short gaps; and the breaks and pauses that are left.

    Parameters
    ----------
    channels : mapping of str to (n,) ndarray
        Of one phase.
    breaks, pauses : mapping of int to int
        As in `split_at_gaps`.
    """
    longest = min(LONGEST, LONGEST_SHARE * channels["voltage"].size)
    short = {at: lost for at, lost in breaks.items() if 0 < lost <= longest and at > 0 and at not in pauses}
    if not short or len(short) > MOST:
        return dict(channels), dict(breaks), dict(pauses)
    at = np.array(sorted(short))
    lost = np.array([short[k] for k in at.tolist()])
    inserted = np.repeat(at, lost)
    behind = np.append(0, np.cumsum(lost))

    def moved(places: Mapping[int, int]) -> dict[int, int]:
        return {k + int(behind[np.searchsorted(at, k, "right")]): n for k, n in places.items() if k not in short}

    extended = {name: np.insert(values, inserted, np.nan) for name, values in channels.items()}
    return extended, moved(breaks), moved(pauses)


def joined(gaps: list[Gap]) -> list[Gap]:
    """Gaps, of which those that are closer together than their length are one; the samples between are too few to test.

    >>> joined([(5, 6), (8, 9), (30, 31)])
    [(5, 9), (30, 31)]
    """
    found: list[Gap] = []
    for a, b in gaps:
        if found and a - found[-1][1] <= found[-1][1] - found[-1][0] + 1:
            found[-1] = (found[-1][0], b)
        else:
            found.append((a, b))
    return found


def filled(voltage: Samples, displacement: Samples, gaps: list[Gap]) -> tuple[Samples, Samples, list[Gap]]:
    """Voltage and displacement with the gaps interpolated where both are smooth; and these gaps.

    Parameters
    ----------
    voltage, displacement : (n,) ndarray
        Not finite where nothing was measured.
    gaps : list of (int, int)
        Where one of them is not finite.
    """
    u, y = voltage.copy(), displacement.copy()
    longest = min(LONGEST, LONGEST_SHARE * u.size)
    short = [(a, b) for a, b in gaps if a > 0 and b < u.size and b - a <= longest]
    if not short or len(short) > MOST:
        return u, y, []
    allowed = [_largest_error(values) for values in (u, y)]
    done = []
    for a, b in short:
        nodes = a - 1 + (b - a + 1) * np.arange(-1, 3)
        if not all(_is_smooth(values, nodes, error) for values, error in zip((u, y), allowed, strict=True)):
            continue
        for values in (u, y):
            lost = a + np.flatnonzero(~np.isfinite(values[a:b]))
            values[lost] = _interpolated(values[nodes], (lost - nodes[1]) / (b - a + 1))
        done.append((a, b))
    return u, y, done


def is_held(voltage: Samples, gap: Gap, lost: int) -> bool:
    """Whether the voltage is the same before and after a gap, and held as long as the gap on both sides.

    Parameters
    ----------
    voltage : (n,) ndarray
        Of the phase.
    gap : (int, int)
        First sample of the gap and first sample after it; they are equal where the samples are left out.
    lost : int
        Length of the gap.
    """
    a, b = gap
    room = 0 < lost <= min(a, voltage.size - b, LONGEST)
    return bool(room and np.ptp(np.append(voltage[a - lost : a], voltage[b : b + lost])) <= _largest_error(voltage))


def _largest_error(values: Samples) -> float:
    """Largest error of an interpolation that is allowed."""
    good = values[np.isfinite(values)]
    span = float(np.ptp(good))
    bends = np.abs(np.diff(good, 2))
    noise = float(np.median(bends)) / (0.6745 * np.sqrt(6.0)) if bends.size else 0.0
    return max(ERROR * span, min(NOISE_WIDTH * noise, MOST_NOISE * span))


def _is_smooth(values: Samples, nodes: NDArray[np.int64], allowed: float) -> bool:
    """Whether the cubic through two samples on either side of a gap is accurate there."""
    if not _all_there(values, nodes):
        return False
    span = int(nodes[1] - nodes[0])
    shifts = span * np.arange(1, 1 + max(1, -(-FEWEST_TESTED // span)))
    for side in (-shifts, shifts):
        tests = [_errors(values, nodes + shift) for shift in side.tolist() if _all_there(values, nodes + shift)]
        errors = np.concatenate([*tests, np.empty(0)])
        if not errors.size or np.abs(errors).max() > allowed:
            return False
    before, across, after = np.diff(values[nodes]).tolist()
    is_step = abs(across) > LARGEST_STEP * max(abs(before), abs(after)) + allowed
    has_corner = before * after < 0.0 and min(abs(before), abs(after)) > LARGEST_CORNER * allowed
    return not (is_step or has_corner)


def _all_there(values: Samples, nodes: NDArray[np.int64]) -> bool:
    return bool(nodes[0] >= 0 and nodes[-1] < values.size and np.isfinite(values[nodes]).all())


def _errors(values: Samples, nodes: NDArray[np.int64]) -> Samples:
    """Errors of the interpolation between the middle two of four nodes, where something was measured."""
    places = np.arange(nodes[1] + 1, nodes[2])
    errors = values[places] - _interpolated(values[nodes], (places - nodes[1]) / (nodes[2] - nodes[1]))
    return np.asarray(errors[np.isfinite(errors)])


def _interpolated(ends: Samples, s: Samples) -> Samples:
    """Lagrange cubic through equidistant values; `s` counts from the second to the third."""
    return np.asarray(
        -s * (s - 1) * (s - 2) / 6 * ends[0]
        + (s + 1) * (s - 1) * (s - 2) / 2 * ends[1]
        - (s + 1) * s * (s - 2) / 2 * ends[2]
        + (s + 1) * s * (s - 1) / 6 * ends[3]
    )
