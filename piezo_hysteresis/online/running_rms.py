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

"""`RunningRms`: root mean square of the newest samples of a stream."""

from __future__ import annotations

from collections import deque

import numpy as np
from numpy.typing import NDArray

from ..errors import ParameterError

Array = NDArray[np.float64]


class RunningRms:
    """Rms over the newest blocks that together hold at least `count` samples, or over all samples if there are fewer.

    Parameters
    ----------
    count : int
        Number of samples, at least 1.

    Examples
    --------
    >>> rms = RunningRms(2)
    >>> rms.add(np.array([9.0, 9.0])), rms.add(np.array([3.0, -3.0])), rms.value
    (None, None, 3.0)
    """

    def __init__(self, count: int) -> None:
        self._count = count
        self.clear()

    @classmethod
    def over(cls, duration: float, sample_period: float) -> RunningRms:
        """The rms over a time [s]; ParameterError if it is not positive."""
        if not 0.0 < duration < np.inf:
            raise ParameterError(f"rms_time: got {duration:g} s, expected a finite time above 0 s")
        return cls(max(1, round(duration / sample_period)))

    @property
    def value(self) -> float | None:
        """Rms of the samples [unit of the samples]; None before the first."""
        return float(np.sqrt(sum(s for _, s in self._squares) / self._held)) if self._held else None

    def add(self, values: Array) -> None:
        """Add the next samples, shape (n,); a stream without a model has none."""
        if not values.size:
            return
        self._squares.append((values.size, float(values @ values)))
        self._held += values.size
        while self._held - self._squares[0][0] >= self._count:
            self._held -= self._squares.popleft()[0]

    def clear(self) -> None:
        """Remove all samples."""
        self._squares: deque[tuple[int, float]] = deque()
        self._held = 0
