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

"""`WaitLimit`: the limit of a wait, in time during which this process could receive messages."""

from __future__ import annotations

import time

_LONGEST_STEP = 0.5
"""Longest time between two checks that counts [s]; a longer one means that this process was suspended."""


class WaitLimit:
    """Passes after a time in which messages could have arrived.

    The messages that reach a suspended process are handled after it runs again. A limit on the clock of the
    computer would pass before them, and the failure would name the wrong reason.

    Parameters
    ----------
    seconds : float
        Longest wait [s], > 0.
    """

    def __init__(self, seconds: float) -> None:
        self._left, self._checked = seconds, time.monotonic()

    def has_passed(self) -> bool:
        """Count the time since the last check, and return True where the wait is over. Call it often."""
        now = time.monotonic()
        self._left -= min(now - self._checked, _LONGEST_STEP)
        self._checked = now
        return self._left < 0.0
