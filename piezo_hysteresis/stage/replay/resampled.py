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

"""`ResampledRecord`: a record at the sample period at which it is played."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...errors import StageError
from ...record import Record, Samples

_TOLERANCE = 1e-6
"""Relative difference of sample periods that count as equal, and of their ratio from a whole number."""


class ResampledRecord:
    """Samples of a record at another sample period, computed when they are asked for.

    A slower record is interpolated linearly between the centres of its samples, which are averages over its sample
    period. A faster one is averaged over blocks.

    Parameters
    ----------
    record : Record
        As it was recorded.
    sample_period : float
        Time between played samples [s].

    Attributes
    ----------
    record : Record
        Source of the samples: the given record, or its averages.
    size : int
        Number of played samples.
    is_resampled : bool
        True if the recorded sample period differs from the played one.

    Raises
    ------
    StageError
        If the played period is longer than the recorded one and not a whole multiple of it.
    """

    def __init__(self, record: Record, sample_period: float) -> None:
        ratio = sample_period / record.sample_period
        factor = max(round(ratio), 1)
        if ratio > 1 and not (abs(ratio / factor - 1) < _TOLERANCE and factor <= record.size):
            raise StageError(
                f"phase '{record.phase}': got {record.size} samples of {record.sample_period:g} s to play at "
                f"{sample_period:g} s, expected a whole multiple of the recorded period that the phase can fill; "
                "set sample_period to another value"
            )
        self.record = record if factor == 1 else record.decimate(factor)
        self.is_resampled = abs(ratio - 1) > _TOLERANCE
        self._step = sample_period / self.record.sample_period if self.is_resampled else 1.0
        self.size = max(round(self.record.size / self._step), 1)

    def at(self, channel: Samples, index: NDArray[Any]) -> Samples:
        """Values of one channel of the record at played samples `index`, each from 0 to `size` - 1."""
        if self._step == 1.0:
            return np.asarray(channel[index])
        place = (index + 0.5) * self._step - 0.5
        first, last = (int(p) for p in np.clip((np.floor(place.min()), np.ceil(place.max())), 0, channel.size - 1))
        return np.asarray(np.interp(place, np.arange(first, last + 1), channel[first : last + 1]))
