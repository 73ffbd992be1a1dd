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

"""`Claim`: determines which owner may move a stage at present."""

from __future__ import annotations

import re

from ..errors import StageError, printable

_OWNER = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_.-]{0,63}")
"""Names that an owner may have."""


class Claim:
    """A claim on a stage. At most one owner holds it and must renew it. Times are in s on the steady clock.

    Parameters
    ----------
    timeout : float
        Time without a renewal after which the claim ends [s].

    Attributes
    ----------
    timeout : float
        The same time; it may be changed.
    owner : str
        Owner of the claim; empty if the stage is not claimed.
    """

    def __init__(self, timeout: float) -> None:
        self.owner, self.timeout = "", timeout
        self._heard = 0.0

    def take(self, owner: str, now: float) -> bool:
        """Claim the stage, or renew the claim; returns whether the owner is new.

        Raises
        ------
        StageError
            If another owner holds the claim, or the name is not allowed.
        """
        if not _OWNER.fullmatch(owner):
            raise StageError(f"claim: got owner {owner[:80]!r}, expected 1 to 64 letters, digits, '_', '.', '-'")
        if self.owner not in ("", owner):
            raise StageError(f"claim of {owner}: {self._taken}")
        is_new = not self.owner
        self.owner, self._heard = owner, now
        return is_new

    def renew(self, owner: str, now: float) -> bool:
        """Renew the claim; returns False if it has ended, for example because the owner was suspended."""
        if not owner or owner != self.owner:
            return False
        self._heard = now
        return True

    def release(self, owner: str) -> bool:
        """Release the claim; returns False if this owner does not hold it."""
        if not owner or owner != self.owner:
            return False
        self.owner = ""
        return True

    def has_expired(self, now: float) -> bool:
        """Whether the owner has not renewed its claim within the time-out."""
        return bool(self.owner) and now - self._heard > self.timeout

    def require(self, owner: str, what: str) -> None:
        """Refuse the request `what` of a sender who does not hold the claim. An empty `owner` claims nothing.

        Raises
        ------
        StageError
            If another owner holds the claim, or `owner` is given and does not hold it.
        """
        if owner == self.owner:
            return
        if self.owner:
            raise StageError(f"{what}: {self._taken}")
        raise StageError(f"{what}: the stage is not claimed by {printable(owner[:64])}; claim it first")

    @property
    def _taken(self) -> str:
        return f"the stage is claimed by {self.owner}; wait until it is released"
