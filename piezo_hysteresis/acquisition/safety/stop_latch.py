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

"""`StopLatch`: forbids motion of the stage after a stop until the user releases it. No ROS."""

from __future__ import annotations

from ...errors import StageError


class StopLatch:
    """A latch that a stop sets and only `release` resets."""

    def __init__(self) -> None:
        self._is_set = False

    @property
    def is_set(self) -> bool:
        """True between a stop and the release."""
        return self._is_set

    def set(self) -> None:
        """Forbid all motion until the release."""
        self._is_set = True

    def release(self) -> bool:
        """Allow motion again; returns whether it had been forbidden."""
        was_set, self._is_set = self._is_set, False
        return was_set

    def require_released(self, name: str) -> None:
        """Raise StageError for the command `name` while the latch is set."""
        if self._is_set:
            raise StageError(f"{name}: the driver was stopped and moves nothing; call ~/release first")
