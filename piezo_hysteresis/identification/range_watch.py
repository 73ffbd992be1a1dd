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

"""`RangeWatch`: whether a stream of samples stays inside the range that a model was identified on."""

from __future__ import annotations

from collections import deque

import numpy as np
from numpy.typing import NDArray

from ..model.model import Model
from ..record import Notice, Record
from .identified_range import SLOWEST, outside_of

SHORTEST = 1.0
"""Shortest time window [s]."""
CYCLES = 3.0
"""Length of the window in cycles of the slowest identified drive, so that a slower drive is detected."""
MOST_SAMPLES = 65536
"""Largest number of samples in the window; they need a few milliseconds of processor time."""


class RangeWatch:
    """The newest drive of a stream, and the parts outside the range of the identification.

    Parameters
    ----------
    model : Model
        Model with its identified range in the provenance; without a range there are no findings.
    sample_period : float
        Sample period of the stream [s].

    Examples
    --------
    >>> from ..effects import BoucWen
    >>> known = {"voltage_min": "0", "voltage_max": "5", "frequency_min": "1", "frequency_max": "10"}
    >>> watch = RangeWatch(Model((BoucWen(),), 1e-3, provenance={**known, "slew_rate_max": "200"}), 1e-3)
    >>> watch.add(np.linspace(0.0, 8.0, 100))
    >>> [n.kind for n in watch.findings()]
    ['outside_amplitudes']
    """

    def __init__(self, model: Model, sample_period: float) -> None:
        self.model = model
        self._period = sample_period
        slowest = float(model.provenance.get(SLOWEST, "0"))
        window = max(SHORTEST, CYCLES / slowest if slowest > 0.0 else 0.0)
        self._size = int(np.clip(window / sample_period, 2, MOST_SAMPLES))
        self._blocks: deque[NDArray[np.float64]] = deque()
        self._count = 0

    def add(self, voltage: NDArray[np.float64]) -> None:
        """Add the next samples [V], shape (n,)."""
        self._blocks.append(voltage[-self._size :].copy())
        self._count += self._blocks[-1].size
        while self._count - self._blocks[0].size >= self._size:
            self._count -= self._blocks.popleft().size

    def findings(self) -> tuple[Notice, ...]:
        """Notices about the newest samples outside the identified range.

        Frequencies are judged when the window is full, because a part of a slow drive does not show its frequency.
        """
        if self._count < 2:
            return ()
        seen = np.concatenate(self._blocks)[-self._size :]
        found = outside_of(self.model, Record(seen, seen, self._period, continues=True))
        is_full = seen.size == self._size
        return tuple(n for n in found if is_full or n.kind != "outside_frequencies")
