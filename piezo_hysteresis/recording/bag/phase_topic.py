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

"""`PhaseNames`: the names from the topic `phase`, which carries ``"<number> <name>"`` at every change."""

from __future__ import annotations

from typing import Any

from ...errors import RecordingError
from .block_message import typestore

STRING = "std_msgs/msg/String"
"""Type of the messages."""


class PhaseNames:
    """Names of phase numbers; numbers start again with the driver, so the time of reception distinguishes them."""

    def __init__(self) -> None:
        self._names: dict[int, list[tuple[int, str]]] = {}

    def __bool__(self) -> bool:
        return bool(self._names)

    def add(self, raw: bytes, received_ns: int) -> None:
        """Add one serialised String.

        Raises
        ------
        RecordingError
            If it is not a number and a name.
        """
        message: Any = typestore().deserialize_cdr(raw, STRING)
        number, _, name = str(message.data).partition(" ")
        if not number.isdecimal() or not name.strip():
            raise RecordingError(f"phase: got '{message.data}', expected a number and a name")
        self._names.setdefault(int(number), []).append((received_ns, name.strip()))

    def at(self, number: int, received_ns: int) -> str | None:
        """Name of a number near a time of reception [ns], None if it was never named."""
        said = self._names.get(number, [])
        return min(said, key=lambda entry: abs(entry[0] - received_ns))[1] if said else None

    @staticmethod
    def to_cdr(number: int, name: str) -> bytes:
        """Serialised String as the driver publishes it."""
        message = typestore().types[STRING](f"{number} {name}")
        return bytes(typestore().serialize_cdr(message, STRING))
