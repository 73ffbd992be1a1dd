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

"""`Tracking`: compares the measured with the wanted displacement while the stage follows a path."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...acquisition.sample_block import SampleBlock
from ...compensation import Plan

Array = NDArray[np.float64]


class Tracking:
    """Collects the samples of one drive.

    Parameters
    ----------
    plan : Plan
        What is played.
    wanted : (n,) ndarray, optional
        Wanted displacement [m]. Default: the path of the plan; a round of learning plays a corrected one.
    """

    def __init__(self, plan: Plan, wanted: Array | None = None) -> None:
        self.plan, self._wanted = plan, plan.wanted if wanted is None else wanted
        self.first: int | None = None
        """Index of the first sample of the drive, once the driver has reported it."""
        self.newest_error: float | None = None
        """Wanted − measured displacement of the newest received sample of the path [m]; None before the first."""
        self.received = 0
        """Number of samples of the drive that have arrived; those that came twice count twice."""
        self.is_whole = False
        """Whether the last sample of the drive has arrived."""
        self.has_passed = False
        """Whether a sample after the drive has arrived."""
        self._squares, self._count = 0.0, 0
        self._measured = np.full(plan.voltage.size, np.nan)
        self._early: list[SampleBlock] = []

    def begin(self, first: int) -> None:
        """Set the index at which the drive begins, and add the blocks that arrived before the driver reported it."""
        self.first = first
        early, self._early = self._early, []
        for block in early:
            self.take(block)

    @property
    def path_index(self) -> int | None:
        """Index of the first sample of the path in `samples`; None before the driver has reported it."""
        return None if self.first is None else (self.first + self.plan.begin) % 2**32

    def take(self, block: SampleBlock) -> None:
        """Add a block of `samples`."""
        if self.first is None:
            self._early = [*self._early[-200:], block]
            return
        begin = (int(block.index[0]) - self.first + 2**31) % 2**32 - 2**31
        a, b = max(begin, 0), min(begin + block.size, self._measured.size)
        if b > a:
            self.received += b - a
            measured, known = block.displacement[a - begin : b - begin], self._measured[a:b]
            self._count_errors(a, np.where(np.isnan(known), measured, np.nan))
            known[:] = measured
            self.is_whole = self.is_whole or b == self._measured.size
        self.has_passed = self.has_passed or begin + block.size > self._measured.size

    def _count_errors(self, begin: int, new: Array) -> None:
        """Add the errors of new samples from drive sample `begin` on; those that are known already are NaN."""
        first = max(self.plan.begin - begin, 0)
        wanted = self._wanted[begin + first - self.plan.begin :][: max(new.size - first, 0)]
        errors = wanted - new[first : first + wanted.size]
        errors = errors[np.isfinite(errors)]
        if errors.size:
            self.newest_error = float(errors[-1])
            self._squares, self._count = self._squares + float(errors @ errors), self._count + errors.size

    @property
    def missing(self) -> int:
        """Number of samples of the drive that were lost, or that are not finite."""
        return int(np.count_nonzero(np.isnan(self._measured)))

    @property
    def measured(self) -> Array:
        """Displacement for every sample of the drive [m], shape (m,); predicted where samples were lost."""
        return np.where(np.isnan(self._measured), self.plan.predicted, self._measured)

    @property
    def rms(self) -> float | None:
        """Rms of wanted − measured displacement of the received samples of the path [m]; None before the first."""
        return float(np.sqrt(self._squares / self._count)) if self._count else None
