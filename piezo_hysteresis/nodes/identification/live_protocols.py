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

"""`LiveProtocols`: the protocols that a live diagnosis plays, one after the other, until it ends."""

from __future__ import annotations

from collections.abc import Callable, Generator
from pathlib import Path

from ...errors import IdentificationError
from ...identification.protocol.drive_limits import DriveLimits
from ...identification.protocol.protocol import Protocol
from ...recording.segmentation.decimation import save_decimation
from ..runtime.fit_process import Outcome
from .live_process import LiveProcess, LiveSettings
from .protocol_runner import Progress


class LiveProtocols:
    """Gives `run_protocols` the phases that are due, and keeps the outcome at the end.

    Parameters
    ----------
    path : Path
        Folder of the bag that is being recorded.
    settings : LiveSettings
        Of the user.
    inform : callable
        Called with the likeliest explanations after every decision.
    """

    def __init__(self, path: Path, settings: LiveSettings, inform: Callable[[str], None]) -> None:
        self._path, self._settings, self._inform = path, settings, inform
        self._process: LiveProcess | None = None
        self._last: Protocol | None = None
        self._averaged: list[tuple[str, int]] = []
        self._found: Outcome | None = None

    @property
    def outcome(self) -> Outcome:
        """Result of the diagnosis; raises IdentificationError before the end."""
        if self._found is None:
            raise IdentificationError("the live diagnosis has not ended, expected its outcome")
        return self._found

    def following(self, limits: DriveLimits) -> Generator[Progress, None, Protocol | None]:
        """Determine the next protocol; None at the end."""
        if self._process is None:
            self._process = LiveProcess(self._path, limits, self._settings)
        elif self._last is not None:
            self._averaged += [(phase.name, phase.stored_every) for phase in self._last]
            save_decimation(self._path, self._averaged)
            self._process.played(self._last.phases)
        while not isinstance(answer := self._process.poll(), Outcome):
            if answer is None:
                yield Progress("deciding", *self._process.progress)
                continue
            if answer.likely:
                self._inform(answer.likely)
            if answer.phases:
                self._last = Protocol(answer.name, limits, answer.phases)
                return self._last
        self._found = answer
        return None

    def close(self) -> None:
        """End the process at once."""
        if self._process is not None:
            self._process.close()
