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

"""`StopLatch`: after a stop nothing moves until it is released. No ROS."""

from __future__ import annotations

from ...errors import StageError


class StopLatch:
    """Set by a stop; only `release` resets it."""

    def __init__(self) -> None:
        self._is_set = False

    @property
    def is_set(self) -> bool:
        """True from a stop on until it is released."""
        return self._is_set

    def set(self) -> None:
        """Let nothing move from now on."""
        self._is_set = True

    def release(self) -> bool:
        """Let commands move the stage again; returns whether they could not."""
        was_set, self._is_set = self._is_set, False
        return was_set

    def require_released(self, name: str) -> None:
        """StageError for the command `name` while the stop holds."""
        if self._is_set:
            raise StageError(f"{name}: the driver was stopped, nothing moves; call ~/release first")
