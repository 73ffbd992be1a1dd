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

"""`ArrayPlace`: where the samples of a channel are in a file of named arrays."""

from __future__ import annotations

import re
from collections.abc import Collection
from dataclasses import dataclass

from ...errors import RecordingError
from ..table.column_inference import inferred_period
from .named_arrays import NamedArrays

_PLACE = re.compile(r"(?P<name>[^\[\]]+?)(\[(?P<column>[1-9]\d{0,8})\])?")
"""Form of a place: ``name[column]``."""
_UNIT = re.compile(r" \([^()]*\)$")
"""Unit behind the name of a channel."""
_SHOWN = 30
"""Largest number of names in a message."""


@dataclass(frozen=True, slots=True)
class ArrayPlace:
    """A vector, or one column of a matrix.

    Parameters
    ----------
    name : str
        Name of the array.
    column : int, optional
        Column counted from 1, as in MATLAB.
    """

    name: str
    column: int | None = None

    def __str__(self) -> str:
        return self.name if self.column is None else f"{self.name}[{self.column}]"

    @classmethod
    def of(cls, arrays: NamedArrays, text: str, channel: str) -> ArrayPlace:
        """The place that a user has named.

        Parameters
        ----------
        arrays : NamedArrays
            The arrays of a file.
        text : str
            ``run.data``, ``run.data[2]``, a name without its group or unit if only one array has it, or the number of
            a column where the file has one matrix.
        channel : str
            Channel that it is for, for messages.

        Raises
        ------
        RecordingError
            If the file has no such array, or several.
        """
        matrices = matrices_of(arrays)
        if text not in arrays and text.isdigit() and len(matrices) == 1:
            return cls(matrices[0], int(text))
        match = None if text in arrays else _PLACE.fullmatch(text)
        name, number = (match["name"], match["column"]) if match else (text, None)
        found = [name] if name in arrays else [full for full in arrays if _is_short_for(full, name)]
        if len(found) == 1:
            return cls(found[0], None if number is None else int(number))
        message = f"`columns`: got '{text}' for {channel}, expected one of "
        if found:
            raise RecordingError(message + f"{', '.join(found)}; give the whole name")
        raise RecordingError(message + listed(arrays) + (f"; column 2 is {matrices[0]}[2]" if matrices else ""))


def listed(arrays: NamedArrays) -> str:
    """The names of arrays, and the shapes of matrices, in words."""
    matrices = matrices_of(arrays)
    names = [f"{n} of shape {arrays.shape(n)}" if n in matrices else n for n in list(arrays)[:_SHOWN]]
    return f"{arrays.kind} {', '.join(names)}"


def example(arrays: NamedArrays, channel: str, taken: Collection[str]) -> str:
    """How to name the place of a channel, for a message: by a matrix, or else by an array that is not used yet."""
    free = (name for name in arrays if name not in taken and not inferred_period([name]))
    places = [f"{name}[1]" for name in matrices_of(arrays)] or list(free)
    return f"; name it by `columns`, e.g. '{channel}={places[0]}'" if places else "; name it by `columns`"


def matrices_of(arrays: NamedArrays) -> list[str]:
    """Names of the first arrays that have several columns."""
    shapes = {name: arrays.shape(name) for name in list(arrays)[:_SHOWN]}
    return [name for name, shape in shapes.items() if len(shape) == 2 and min(shape) > 1]


def _is_short_for(full: str, name: str) -> bool:
    """Whether a name is the end of another, which has a group in front or a unit behind.

    >>> [_is_short_for("Untitled.Dev1/ai3 (V)", name) for name in ("Dev1/ai3", "Dev1/ai3 (V)", "ai3")]
    [True, True, False]
    """
    return any(whole == name or whole.endswith(f".{name}") for whole in (full, _UNIT.sub("", full)))
