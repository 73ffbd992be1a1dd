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
from collections.abc import Iterable

from ...errors import RecordError

_PHASE_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,63}")
"""Names that a phase may have."""

PHASE_FIELD = "phase:"
"""Beginning of the name of a field that names the phase of a waveform; its bytes are those of another field."""


def phase_text(fields: Iterable[str], frame_id: str, frame: str) -> str:
    """Text that names the phase of a waveform, and its owner; empty where none is given.

    The first field that names the phase counts.

    Parameters
    ----------
    fields : iterable of str
        Names of the fields of the message.
    frame_id : str
        Of its header. Senders that know no such field name the phase here.
    frame : str
        Frame of the axis; a `frame_id` that equals it is no name of a phase.

    Examples
    --------
    >>> phase_text(["voltage", "phase:triangle"], "stage_x", "stage_x"), phase_text(["voltage"], "triangle", "stage_x")
    ('triangle', 'triangle')
    """
    named = (name.removeprefix(PHASE_FIELD) for name in fields if name.startswith(PHASE_FIELD))
    return next(named, "" if frame_id == frame else frame_id)


def phase_name(text: str) -> str:
    """Name of a commanded phase; `command` where no name is given.

    Raises
    ------
    RecordError
        If the name cannot be part of a file name.
    """
    if not text:
        return "command"
    if not _PHASE_NAME.fullmatch(text):
        raise RecordError(f"phase name: got {text[:80]!r}, expected 1 to 64 letters, digits, '_', '.', '-'")
    return text


def phase_and_owner(text: str) -> tuple[str, str]:
    """Name and owner of a commanded phase, from ``"<name>@<owner>"``; the owner is empty if none is given.

    Raises
    ------
    RecordError
        As `phase_name`.
    """
    name, _, owner = text.partition("@")
    return phase_name(name), owner
