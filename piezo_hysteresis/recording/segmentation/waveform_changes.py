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

"""Where a drive without rests changes from one waveform to another: from sines to triangles, to another rate, to noise.

Alike swings in a row are a waveform; swings that have neither the shape of a sine nor that of a triangle for long are
noise, or a multisine.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...record import Samples
from .swing_shapes import COSINE, OTHER, STRAIGHT, UNSEEN, swing_shapes, turning_points

_LEAST_SWING = 0.05
"""Least swing of a turning point, share of the range."""
_STEADY = 0.05, 1.5
"""Largest difference of the durations of two swings of one waveform: share of them, and samples."""
_OTHER_RATE = 1.3
"""Ratio of two rates from which they are two waveforms; a chirp changes less from swing to swing."""
_FEWEST = 4
"""Swings of the shortest waveform: two periods."""
_FEWEST_BESIDE_NOISE = 8
"""Swings of the shortest waveform beside unsteady ones, where a few swings are alike by chance."""
_SAME_HEIGHT = 1.15
"""Largest ratio of the heights of most swings of a waveform beside unsteady ones."""
_LEAST_GROWTH = 0.02
"""Smaller changes of the height from swing to swing, as a share of the largest height, are no growth."""
_TRANSITION = 2
"""Most swings between two waveforms that belong to none."""
_NOISE = 16
"""Fewest swings of noise."""
_MAJORITY = 0.8
"""Share of swings of one shape from which unsteady swings are a waveform, such as a chirp."""
_MOST = 20
"""Waveforms in a drive; more are one drive that wanders."""


@dataclass(frozen=True, slots=True)
class _Run:
    """Swings `first` to `stop`: of one shape and steady, or unsteady."""

    first: int
    stop: int
    steady: bool

    @property
    def size(self) -> int:
        return self.stop - self.first


def waveform_changes(voltage: Samples) -> list[int]:
    """First sample of every waveform but the first; empty where the drive is one waveform.

    Parameters
    ----------
    voltage : (n,) ndarray
        Drive [V] without rests.

    Returns
    -------
    list of int

    Examples
    --------
    >>> t = np.arange(4000) * 1e-3
    >>> slow, fast = 1 - np.cos(2 * np.pi * 2 * t), 1 - np.cos(2 * np.pi * 5 * t)
    >>> waveform_changes(np.concatenate((slow, fast))), waveform_changes(slow)
    ([4000], [])
    """
    span = float(np.ptp(voltage))
    turns = turning_points(voltage, _LEAST_SWING * span)
    if span == 0.0 or turns.size <= 2 * _FEWEST:
        return []
    swings = _Swings(swing_shapes(voltage, turns), np.diff(turns), np.abs(np.diff(voltage[turns])))
    waveforms = swings.joined(swings.without_chance(swings.runs()))
    return [int(turns[run.first]) for run in waveforms[1:]] if len(waveforms) <= _MOST else []


@dataclass(frozen=True, eq=False, slots=True)
class _Swings:
    """Shape, number of samples and height of every swing."""

    shape: NDArray[np.int8]
    size: NDArray[np.int64]
    height: NDArray[np.float64]

    def runs(self) -> list[_Run]:
        """Steady swings in a row, and what is between them; a transition belongs to the run behind it."""
        found: list[_Run] = []
        end = 0
        for run in self._steady():
            if run.size < _FEWEST:  # swings without a shape are runs of one
                continue
            if run.first - end > _TRANSITION:
                found += [_Run(end, run.first, False), run]
            else:
                found.append(_Run(end, run.stop, True))
            end = run.stop
        if (left := self.shape.size - end) > _TRANSITION or not found:
            found.append(_Run(end, self.shape.size, False))
        elif left:
            found[-1] = _Run(found[-1].first, self.shape.size, True)
        return found

    def _steady(self) -> list[_Run]:
        """Straight swings of one duration or one slope are alike: triangles, and minor loops."""
        slope = self.height / self.size
        share, samples = _STEADY
        found: list[_Run] = []
        first = 0
        for i in range(1, self.shape.size + 1):
            if i < self.shape.size and self.shape[i] == self.shape[first] in (STRAIGHT, COSINE):
                alike = abs(self.size[i] - self.size[first]) <= share * self.size[first] + samples
                if alike or (self.shape[i] == STRAIGHT and abs(slope[i] / slope[first] - 1.0) <= share):
                    continue
            found.append(_Run(first, i, True))
            first = i
        return found

    def without_chance(self, runs: list[_Run]) -> list[_Run]:
        """A few alike swings beside unsteady ones, or between them, are unsteady too; unsteady neighbours are one."""
        kept: list[_Run] = []
        for i, run in enumerate(runs):
            unsteady = [not other.steady for other in (*runs[max(i - 1, 0) : i], *runs[i + 1 : i + 2])]
            chance = any(unsteady) and (not self._is_sure(run) or (len(unsteady) > 1 and all(unsteady)))
            if kept and not kept[-1].steady and (chance or not run.steady):
                kept[-1] = _Run(kept[-1].first, run.stop, False)
            else:
                kept.append(_Run(run.first, run.stop, run.steady and not chance))
        return kept

    def _is_sure(self, run: _Run) -> bool:
        """True for swings of equal or steadily changing height that are too many to be alike by chance."""
        height = self.height[run.first : run.stop]
        low, high = np.quantile(height, (0.2, 0.8))
        growth = np.diff(height)
        growth = np.sign(growth[np.abs(growth) > _LEAST_GROWTH * float(height.max())])
        turns = np.count_nonzero(np.diff(growth))
        steadily = growth.size > 0 and (turns + 1) * _FEWEST_BESIDE_NOISE <= run.size
        return run.size >= _FEWEST_BESIDE_NOISE and bool(high < _SAME_HEIGHT * low or steadily)

    def joined(self, runs: list[_Run]) -> list[_Run]:
        """Runs that are one waveform, joined: of one shape and rate, also around a disturbance."""
        kept: list[_Run] = []
        begin = -1  # of a short part without a shape that belongs to the run behind it
        for i, run in enumerate(runs):
            if begin >= 0:
                run = _Run(begin, run.stop, run.steady)
                begin = -1
            if 0 < i < len(runs) - 1 and self._belongs_to(run, runs[i + 1], kept[-1]):
                begin = run.first
                continue
            kept.append(run)
            while len(kept) > 1 and self._are_one(kept[-2], kept[-1]):
                kept[-2:] = [_Run(kept[-2].first, run.stop, kept[-2].steady and run.steady)]
            if len(kept) > 2 and not self._shape(kept[-2]) and self._are_one(kept[-3], kept[-1]):
                kept[-3:] = [_Run(kept[-3].first, run.stop, True)]
        return kept

    def _belongs_to(self, run: _Run, behind: _Run, before: _Run) -> bool:
        """True for a short run without a shape whose rate is closer to the run behind it than to the one before."""
        if self._shape(run) or run.size >= _NOISE:
            return False
        own, early, late = (np.log(np.median(self.size[r.first : r.stop])) for r in (run, before, behind))
        return bool(abs(own - late) < abs(own - early))

    def _are_one(self, a: _Run, b: _Run) -> bool:
        shapes = {self._shape(a), self._shape(b)}
        if shapes == {OTHER} or any(not self._shape(run) and run.size < _NOISE for run in (a, b)):
            return True
        ends = self.size[max(a.first, a.stop - _FEWEST) : a.stop], self.size[b.first : b.first + _FEWEST]
        fast, slow = sorted(float(np.median(end)) for end in ends)
        return (
            shapes != {STRAIGHT, COSINE} and slow < _OTHER_RATE * fast
        )  # without a sure change of shape the rate decides

    def _shape(self, run: _Run) -> int:
        """Shape of most of its swings, or 0; the short ones may have any."""
        counts = np.bincount(self.shape[run.first : run.stop], minlength=UNSEEN + 1)
        if counts[UNSEEN] >= _MAJORITY * run.size:
            return UNSEEN
        shape = int(counts[:UNSEEN].argmax())
        return shape if counts[shape] + counts[UNSEEN] >= _MAJORITY * run.size else OTHER
