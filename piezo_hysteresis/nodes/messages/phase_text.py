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

"""Names of phases in commands and messages. No ROS."""

from __future__ import annotations

import re

from ...errors import RecordError

_PHASE_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,63}")
"""Names that a phase may have."""


def phase_name(frame_id: str) -> str:
    """Name of a commanded phase; `command` where no name is given.

    Raises
    ------
    RecordError
        If the name cannot be part of a file name.
    """
    if not frame_id:
        return "command"
    if not _PHASE_NAME.fullmatch(frame_id):
        raise RecordError(
            f"frame_id: got {frame_id[:80]!r} as phase name, expected 1 to 64 letters, digits, '_', '.', '-'"
        )
    return frame_id


def phase_and_owner(frame_id: str) -> tuple[str, str]:
    """Name and owner of a commanded phase, from ``"<name>@<owner>"``; the owner is empty if none is given.

    Raises
    ------
    RecordError
        As `phase_name`.
    """
    name, _, owner = frame_id.partition("@")
    return phase_name(name), owner


def phase_from_text(text: str) -> tuple[int, str]:
    """Number and name of a message of `phase`, ``"<number> <name>"``.

    Raises
    ------
    RecordError
        If the text has another form.
    """
    number, _, name = text.partition(" ")
    if not (number.isascii() and number.isdigit() and name):
        raise RecordError(f"phase: got {text[:80]!r}, expected '<number> <name>'")
    return int(number), name
