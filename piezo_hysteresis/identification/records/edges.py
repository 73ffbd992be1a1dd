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

"""`Edge`: a jump of the drive between two quiet intervals."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...record import Samples


@dataclass(frozen=True, slots=True)
class Edge:
    """A jump of the drive.

    Parameters
    ----------
    start : int
        First sample that differs from the old level.
    height : float
        New level minus old level [V].
    quiet_before, quiet_after : int
        Samples at the old level before `start`, and samples from `start` until the drive leaves the new level.
    """

    start: int
    height: float
    quiet_before: int
    quiet_after: int


def find_edges(voltage: Samples, before: int, after: int, tolerance: float = 0.02, longest: int = 8) -> list[Edge]:
    """Edges between levels that are quiet to `tolerance` of the voltage range of the record.

    Parameters
    ----------
    voltage : (n,) array
        Drive [V].
    before, after : int
        Smallest number of quiet samples before and after.
    tolerance : float
        Changes below this fraction of the range count as quiet.
    longest : int
        Largest number of samples of an edge.

    Returns
    -------
    list of Edge
        Edges in order of time.
    """
    span = float(np.ptp(voltage))
    if span == 0.0:
        return []
    moving = np.flatnonzero(np.abs(np.diff(voltage)) > tolerance * span) + 1
    if moving.size == 0:
        return []
    groups = np.split(moving, np.flatnonzero(np.diff(moving) > 1) + 1)
    stops = [*(int(g[0]) for g in groups[1:]), voltage.size]
    edges = []
    last = 0
    for group, stop in zip(groups, stops, strict=True):
        start, end = int(group[0]), int(group[-1])
        level, new = voltage[max(last, start - 4 * before) : start], voltage[end : min(stop, end + 4 * after)]
        height = float(np.mean(new) - np.mean(level)) if level.size else 0.0
        quiet = level.size >= before and new.size >= after and end - start < longest
        if quiet and max(np.ptp(level), np.ptp(new)) <= tolerance * span and abs(height) > 10 * tolerance * span:
            edges.append(Edge(start, height, start - last, stop - start))
        last = end
    return edges
