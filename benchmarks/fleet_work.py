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

"""`Wait`: work of a known length, for tests and measurements of a fleet; workers import it from here."""

from __future__ import annotations

import os
import time
from dataclasses import dataclass

from piezo_hysteresis.fleet import time_limit
from piezo_hysteresis.fleet.work_result import WorkResult
from piezo_hysteresis.record import Experiment


@dataclass(frozen=True, slots=True)
class Wait:
    """Waits for a fixed time, and ends its process at a recording with a phase ``crash``.

    At a phase ``stuck``, it waits in one call that nothing interrupts, and shortens the grace of its process.

    Parameters
    ----------
    seconds : float
        Time [s].
    """

    seconds: float = 1.0
    name = "wait"

    def settings(self) -> str:
        """The time."""
        return f"wait {self.seconds!r}"

    def __call__(self, experiment: Experiment) -> WorkResult:
        """Wait in short steps, as Python code does."""
        if experiment.named("crash"):
            os._exit(9)
        if experiment.named("stuck"):
            time_limit.GRACE = 0.1
            time.sleep(self.seconds)
        end = time.monotonic() + self.seconds
        while (left := end - time.monotonic()) > 0.0:
            time.sleep(min(left, 0.05))
        return WorkResult("waited", error_percent=0.1)
