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

"""`RecentDisplacement`: keeps the measured displacement of the last minute, so that a model can be fitted to it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .voltage_history import FULL_SAMPLES

Array = NDArray[np.float64]

DURATION = 60.0
"""Time that is kept [s]; less where it would hold more than `FULL_SAMPLES` samples."""


class RecentDisplacement:
    """Ring buffer of consecutive samples without a gap.

    Parameters
    ----------
    sample_period : float
        Time between samples [s].
    """

    def __init__(self, sample_period: float) -> None:
        self.sample_period = sample_period
        self._ring = np.empty(max(1, min(round(DURATION / sample_period), FULL_SAMPLES)))
        self._next: int | None = None
        self._end = self._filled = 0

    def add(self, index: int, displacement: Array) -> None:
        """Add a block of samples. If samples are missing before it, the older samples are removed.

        Parameters
        ----------
        index : int
            Running index of the first sample, modulo 2³².
        displacement : (n,) ndarray
            Measured displacement [m].
        """
        if index != self._next:
            self.clear()
        self._next = (index + displacement.size) % 2**32
        newest = displacement[-self._ring.size :]
        ahead = min(newest.size, self._ring.size - self._end)
        self._ring[self._end : self._end + ahead] = newest[:ahead]
        self._ring[: newest.size - ahead] = newest[ahead:]
        self._end = (self._end + newest.size) % self._ring.size
        self._filled = min(self._filled + newest.size, self._ring.size)

    def clear(self) -> None:
        """Remove all samples."""
        self._next, self._end, self._filled = None, 0, 0

    def copy(self) -> Array:
        """A copy of the samples [m], the oldest first, shape (n,)."""
        start = self._end - self._filled
        if start < 0:
            return np.concatenate((self._ring[start:], self._ring[: self._end]))
        return self._ring[start : self._end].copy()
