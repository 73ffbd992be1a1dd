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

"""`StreamPeriod`: the sample period of the blocks of `samples`."""

from __future__ import annotations

from ...acquisition.sample_block import SampleBlock

TOLERANCE = 0.01
"""Largest relative difference of two periods that count as the same."""


class StreamPeriod:
    """Finds the sample period in the blocks, one after the other.

    A device that plays from its memory sends single samples while it rests. Between two of them, a step of the clock or
    a restart of the driver looks like another period. Such an estimate counts only if the one before agrees with it.
    """

    def __init__(self) -> None:
        self._before: SampleBlock | None = None
        self._estimate: float | None = None

    def of(self, block: SampleBlock) -> float | None:
        """Period at the next block [s]; None while it is not known from this block and those before it."""
        before, self._before = self._before, block
        last, self._estimate = self._estimate, None
        if block.sample_period is not None:
            return block.sample_period if block.sample_period > 0 else None
        if before is None:
            return None
        steps = (int(block.index[0]) - int(before.index[-1]) + 2**31) % 2**32 - 2**31  # negative after a restart
        elapsed = (block.stamp - before.stamp) * 1e-9 + float(block.time[0]) - float(before.time[-1])
        if steps <= 0 or elapsed <= 0:
            return None
        self._estimate = elapsed / steps
        return self._estimate if last is not None and abs(self._estimate / last - 1.0) <= TOLERANCE else None
