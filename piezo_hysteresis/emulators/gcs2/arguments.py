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

"""Checks of the arguments of GCS 2.0 commands for an emulated controller with one axis and one channel.

An invalid argument raises `Refusal` with the error number of the controller.
"""

from __future__ import annotations

from collections.abc import Callable

from ...stage.gcs2.error_number import ILLEGAL_AXIS, NO_RECORDER_TABLE, OUT_OF_RANGE, WRONG_COUNT
from .answer import items
from .refusal import Refusal

AXIS, CHANNEL = "1", 1
"""The one axis of the emulated controller, and its channel."""

Command = Callable[[list[str]], list[str] | None]
"""Function of the arguments of a command; returns the lines of the answer, or None if the command has no answer."""


def groups(arguments: list[str], size: int) -> list[list[str]]:
    """The arguments in groups of `size`, at least one group."""
    if not arguments or len(arguments) % size:
        raise Refusal(WRONG_COUNT)
    return [arguments[i : i + size] for i in range(0, len(arguments), size)]


def axes(arguments: list[str]) -> list[str]:
    """Requested axes; all axes if none is named."""
    if any(axis != AXIS for axis in arguments):
        raise Refusal(ILLEGAL_AXIS)
    return arguments or [AXIS]


def channels(arguments: list[str]) -> list[int]:
    """Requested output channels or generators; all if none is named."""
    if any(int(channel) != CHANNEL for channel in arguments):
        raise Refusal(ILLEGAL_AXIS)
    return [CHANNEL]


def tables(arguments: list[str], known: range) -> list[int]:
    """Requested recorder tables; all if none is named."""
    chosen = [int(table) for table in arguments] or list(known)
    if not set(chosen) <= set(known):
        raise Refusal(NO_RECORDER_TABLE)
    return chosen


def positive(word: str) -> int:
    """A whole number from 1 on."""
    if int(word) < 1:
        raise Refusal(OUT_OF_RANGE)
    return int(word)


def of_axis(value: Callable[[], float | str]) -> Command:
    """The command that queries a value of the axis."""
    return lambda arguments: items(dict.fromkeys(axes(arguments), value()))


def of_channel(value: Callable[[], float | str]) -> Command:
    """The command that queries a value of the output channel or generator."""
    return lambda arguments: items(dict.fromkeys(channels(arguments), value()))
