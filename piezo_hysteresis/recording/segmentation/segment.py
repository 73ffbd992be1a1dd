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
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from ...record import Samples


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
        """The segment with `average` samples averaged into one, not across gaps.

        The incomplete rest before a gap is dropped; samples between two gaps can all be such a rest.
        """
        if average == 1:
            return self
        holes = {**self.breaks, **self.pauses}
        edges = [0, *sorted(holes), self.size]
        starts = np.cumsum([0, *((b - a) // average for a, b in itertools.pairwise(edges))]).tolist()
        moved = dict(zip(edges[1:-1], starts[1:-1], strict=True))
        first = max((at for at in moved if not moved[at]), default=0)
        ahead = first + sum(lost for at, lost in holes.items() if 0 < at <= first)

        def after(places: Mapping[int, int]) -> dict[int, int]:
            lost: dict[int, int] = {}
            for at in (at for at in places if 0 < moved[at] < starts[-1]):
                lost[moved[at]] = lost.get(moved[at], 0) + max(1, round(places[at] / average))
            return lost

        return replace(
            self,
            channels={
                name: np.concatenate([_averaged(values[a:b], average) for a, b in itertools.pairwise(edges)])
                for name, values in self.channels.items()
            },
            sample_period=self.sample_period * average,
            start_time=self.start_time + ahead * self.sample_period,
            lost=self.lost + ahead,
            breaks=after(self.breaks),
            pauses=after(self.pauses),
        )


def _averaged(values: Samples, average: int) -> Samples:
    return np.asarray(values[: values.size // average * average].reshape(-1, average).mean(axis=1))
