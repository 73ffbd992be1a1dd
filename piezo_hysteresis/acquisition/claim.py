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

"""`Claim`: the one owner that may move a stage at present."""

from __future__ import annotations

import re

from ..errors import StageError, printable

_OWNER = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_.-]{0,63}")
"""What an owner may call itself."""


class Claim:
    """At most one owner at a time. The owner renews its claim. Times are in s on the steady clock.

    Parameters
    ----------
    timeout : float
        Time after which an owner that was not heard any more is taken for dead [s].

    Attributes
    ----------
    timeout : float
        As given; may be set.
    owner : str
        Who holds the claim; empty where nobody does.
    """

    def __init__(self, timeout: float) -> None:
        self.owner, self.timeout = "", timeout
        self._heard = 0.0

    def take(self, owner: str, now: float) -> bool:
        """Claim the stage, or repeat the claim; whether the owner is a new one.

        Raises
        ------
        StageError
            If the stage is claimed by another one, or the name is none.
        """
        if not _OWNER.fullmatch(owner):
            raise StageError(f"claim: got owner {owner[:80]!r}, expected 1 to 64 letters, digits, '_', '.', '-'")
        if self.owner not in ("", owner):
            raise StageError(f"claim of {owner}: {self._taken}")
        is_new = not self.owner
        self.owner, self._heard = owner, now
        return is_new

    def renew(self, owner: str, now: float) -> bool:
        """Repeat the claim where it holds; False where it has ended, which an owner that stood still must learn."""
        if not owner or owner != self.owner:
            return False
        self._heard = now
        return True

    def release(self, owner: str) -> bool:
        """Give the claim up; False where this owner does not hold it."""
        if not owner or owner != self.owner:
            return False
        self.owner = ""
        return True

    def has_expired(self, now: float) -> bool:
        """Whether the owner has not been heard for longer than the time-out."""
        return bool(self.owner) and now - self._heard > self.timeout

    def require(self, owner: str, what: str) -> None:
        """Refuse what somebody else asks for while the stage is claimed; an empty `owner` is anybody.

        Raises
        ------
        StageError
            If the stage is claimed by another one, or `owner` does not hold the claim that it names.
        """
        if owner == self.owner:
            return
        if self.owner:
            raise StageError(f"{what}: {self._taken}")
        raise StageError(f"{what}: the stage is not claimed by {printable(owner[:64])}; claim it first")

    @property
    def _taken(self) -> str:
        return f"the stage is claimed by {self.owner}; wait until it is released"
