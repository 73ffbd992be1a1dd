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

"""`SensorOffset`: the offset between a sensor, whose zero is arbitrary, and a model."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

TIME = 0.1
"""Time over which the offset is averaged [s]."""

FEWEST = 20
"""Fewest samples over which the offset is averaged."""


class SensorOffset:
    """Mean of measured minus modelled displacement over a window of the stream.

    Parameters
    ----------
    start : int
        First sample of the window.
    wanted : int
        Number of samples to average. The offset can be used after the first sample; each further one improves it.
    at_rest : bool
        True if the owner closes the window as soon as the stage leaves rest.

    Attributes
    ----------
    until : float
        The window stays open at least until the travel of the drive reaches this value [V], so that it covers a whole
        loop; 0 if the number of samples alone closes it.
    """

    def __init__(self, start: int, wanted: int, at_rest: bool = False) -> None:
        self.start, self.stop = start, start
        self.at_rest, self.until = at_rest, 0.0
        self._end = start + wanted
        self._measured = self._modelled = self._known = 0.0

    @classmethod
    def known(cls, start: int, offset: float) -> SensorOffset:
        """A known offset [m], valid from sample `start` on; no samples are averaged."""
        zero = cls(start, 0)
        zero._known = offset
        return zero

    @property
    def offset(self) -> float:
        """Sensor minus model [m]; before the first sample it is the known offset, or 0."""
        return (self._measured - self._modelled) / (self.stop - self.start) if self.stop > self.start else self._known

    @property
    def so_far(self) -> tuple[SensorOffset, int]:
        """The measurement itself, and the end of its samples so far."""
        return self, self.stop

    def add(self, measured: Array, modelled: Array | None, travel: float) -> None:
        """Add the next samples that lie in the window.

        Parameters
        ----------
        measured, modelled : (n,) ndarray
            Displacement [m]; `modelled` is None without a model.
        travel : float
            Travel of the drive so far [V].
        """
        if travel < self.until:
            self._end = max(self._end, self.stop + measured.size)
        count = min(measured.size, self._end - self.stop)
        if count <= 0:
            return
        self._measured += float(measured[:count].sum())
        if modelled is not None:
            self._modelled += float(modelled[:count].sum())
        self.stop += count

    def close(self) -> None:
        """Close the window; later samples are ignored."""
        self._end = self.stop

    def remodel(self, mean: float) -> None:
        """Replace the modelled displacement by that of another model, whose mean over the window is `mean` [m]."""
        self._modelled = mean * (self.stop - self.start)


def samples_to_average(sample_period: float) -> int:
    """Number of samples over which the offset is averaged, at a given sample period [s]."""
    return max(FEWEST, round(TIME / sample_period))
