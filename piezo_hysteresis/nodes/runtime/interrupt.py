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

"""Remembers an interrupt during the start of a node, also where a library discards its exception.

A `KeyboardInterrupt` in a destructor, or in a library that catches all exceptions, is lost, and the node would
continue.
"""

from __future__ import annotations

import signal
from types import FrameType

_asked: list[int] = []


def remember_interrupts() -> None:
    """Remember every SIGINT from now on, and raise `KeyboardInterrupt` as Python does; ignored signals stay ignored."""
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, _on_interrupt)


def was_interrupted() -> bool:
    """Whether a SIGINT has arrived since `remember_interrupts`."""
    return bool(_asked)


def _on_interrupt(number: int, frame: FrameType | None) -> None:
    _asked.append(number)
    raise KeyboardInterrupt
