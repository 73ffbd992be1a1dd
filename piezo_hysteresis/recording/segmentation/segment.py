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

"""`Segment`: samples of one phase from a stream."""

from __future__ import annotations

import itertools
from dataclasses import dataclass, replace

import numpy as np

from ...record import Samples
from .decimating_buffer import DecimatingBuffer


@dataclass(frozen=True, eq=False, slots=True)
class Segment:
    """Samples of one phase number and one sample period."""

    channels: dict[str, Samples]
    """Voltage [V], displacement [m] and the further channels of the blocks."""
    sample_period: float
    phase: int
    start_time: float
    """Time of the first sample since the first one of the stream [s]."""
    received_ns: int
    """Time at which its first block was received [ns]."""
    lost: int
    """Samples missing just before it."""
    breaks: dict[int, int]
    """Sample before which others are missing, to their number."""
    pauses: dict[int, int]
    """Sample before which others were never measured while the voltage was held, to their number."""
    first: bool
    """True for the first segment since a start of the driver, or of the recording."""

    @property
    def size(self) -> int:
        """Number of samples."""
        return self.channels["voltage"].size

    @property
    def end_time(self) -> float:
        """Time of the sample after the last one since the first one of the stream [s]."""
        missing = sum(n for at, n in (*self.breaks.items(), *self.pauses.items()) if at)
        return self.start_time + (self.size + missing) * self.sample_period

    def averaged(self, average: int) -> Segment:
        """The segment with `average` samples averaged into one, not across gaps; the incomplete rest is dropped."""
        if average == 1:
            return self
        holes = sorted({**self.breaks, **self.pauses}.items())
        edges = [0, *(at for at, _ in holes), self.size]
        starts = np.cumsum([0, *((b - a) // average for a, b in itertools.pairwise(edges))]).tolist()
        moved = dict(zip([at for at, _ in holes], starts[1:], strict=False))
        channels = {
            name: np.concatenate([_averaged(values[a:b], average) for a, b in itertools.pairwise(edges)])
            for name, values in self.channels.items()
        }
        return replace(
            self,
            channels=channels,
            sample_period=self.sample_period * average,
            breaks={moved[at]: max(1, round(lost / average)) for at, lost in self.breaks.items()},
            pauses={moved[at]: max(1, round(lost / average)) for at, lost in self.pauses.items()},
        )


def _averaged(values: Samples, average: int) -> Samples:
    buffer = DecimatingBuffer(1, average=average)
    buffer.add_column(values)
    return buffer.column(0)
