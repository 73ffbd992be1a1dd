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
