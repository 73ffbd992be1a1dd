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

"""`safe_session`: a session on a stage that no number of Ctrl-C leaves energised."""

from __future__ import annotations

import signal
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from types import FrameType
from typing import Any, Protocol, TypeVar

from ...acquisition.safety.console import Console
from ...acquisition.session import DriverSession
from ...acquisition.settings import DriverSettings

_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
"""Signals that end a command; SIGHUP is sent when the terminal is closed."""


class Closable(Protocol):
    """A stage or a session on one."""

    def close(self) -> None:
        """Go to the safe voltage and release the device."""


_Opened = TypeVar("_Opened", bound=Closable)


@contextmanager
def safe_session(settings: DriverSettings, values: Mapping[str, Any], place: str) -> Iterator[DriverSession]:
    """Open a session for the block, and bring its stage to the safe voltage at the end, as `closed_safely` does.

    Parameters
    ----------
    settings, values, place
        As for `DriverSession`.
    """
    with closed_safely(lambda: DriverSession(settings, values, place)) as session:
        yield session


@contextmanager
def closed_safely(opening: Callable[[], _Opened]) -> Iterator[_Opened]:
    """Open a stage for the block, and close it at the end, whatever signals arrive.

    The first of `_SIGNALS` raises KeyboardInterrupt in the block. After it, and while the stage closes, all of them
    are ignored, because they would interrupt the ramp to the safe voltage. A paused terminal delays neither.

    Parameters
    ----------
    opening : callable
        Opens the stage, or a session on it.
    """
    with _handlers_kept() as before, Console():
        for number, handler in before.items():
            if handler is not signal.SIG_IGN:
                signal.signal(number, _interrupt)
        opened = opening()
        try:
            yield opened
        finally:
            try:
                _ignore()
            finally:  # also where a signal has arrived just then
                opened.close()


@contextmanager
def uninterrupted() -> Iterator[None]:
    """Ignore `_SIGNALS` in the block: while a recording is written, another one must not lose it."""
    with _handlers_kept():
        _ignore()
        yield


@contextmanager
def _handlers_kept() -> Iterator[dict[signal.Signals, Any]]:
    """The handlers of `_SIGNALS`, which are set again after the block."""
    before = {number: signal.getsignal(number) for number in _SIGNALS}
    try:
        yield before
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _ignore() -> None:
    for number in _SIGNALS:
        signal.signal(number, signal.SIG_IGN)


def _interrupt(number: int, frame: FrameType | None) -> None:
    _ignore()
    raise KeyboardInterrupt
