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

"""`Fault`: a fault of an emulated device or of its stage, and when it occurs."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from ..errors import StageError

TIMES = ("slow", "trickle")
"""Kinds whose value is a time [s]."""


@dataclass(frozen=True, slots=True)
class Fault:
    """A fault and its trigger.

    Parameters
    ----------
    kind : str
        Key of a `FaultCatalogue`.
    command : str
        Command or call at which it occurs, in capitals; empty for a lasting fault that is present from the start.
    occurrence : int
        Number of the occurrence of the command at which the fault occurs.
    value : float
        Number that belongs to some kinds: a time [s], an error number or a reading.
    lasts : bool
        False if the fault occurs once, True if it lasts from then on.
    """

    kind: str
    command: str = ""
    occurrence: int = 1
    value: float = 0.0
    lasts: bool = False


@dataclass(frozen=True, slots=True)
class FaultCatalogue:
    """Faults of one kind of device.

    Parameters
    ----------
    once : mapping of str to (str, str)
        Faults that occur once: kind -> (``COMMAND[:occurrence]`` at which it occurs by default, what happens).
    lasting : mapping of str to str
        Faults that last, from the start or from a command on: kind -> what happens.
    values : mapping of str to float
        Default value by kind; the other kinds take none.
    """

    once: Mapping[str, tuple[str, str]]
    lasting: Mapping[str, str]
    values: Mapping[str, float] = field(default_factory=dict)

    @property
    def meaning(self) -> dict[str, str]:
        """What happens, by kind of fault."""
        return {**{kind: what for kind, (_, what) in self.once.items()}, **self.lasting}

    def parse(self, text: str) -> Fault:
        """Read ``kind[@COMMAND[:occurrence]][=value]``.

        Raises
        ------
        StageError
            If the text does not have this form, the kind is unknown, or the value is none of this kind.

        Examples
        --------
        >>> faults = FaultCatalogue({"slow": ("POS?", "the answer is late")}, {}, values={"slow": 1.0})
        >>> faults.parse("slow@VOL?:2=0.5")
        Fault(kind='slow', command='VOL?', occurrence=2, value=0.5, lasts=False)
        """
        front, _, value = text.partition("=")
        kind, _, trigger = front.partition("@")
        if kind not in self.meaning:
            raise StageError(f"fault: got '{kind}', expected one of {', '.join(self.meaning)}")
        command, _, occurrence = (trigger or self.once.get(kind, ("",))[0]).partition(":")
        try:
            at, number = int(occurrence or 1), float(value) if value else self.values.get(kind, 0.0)
        except ValueError:
            raise StageError(f"fault: got '{text}', expected kind@COMMAND:occurrence=value") from None
        if at < 1:
            raise StageError(f"fault: got '{text}', expected occurrences counted from 1")
        if value and kind not in self.values:
            raise StageError(f"fault: got '{text}', expected no value; {', '.join(self.values)} take one")
        if kind in TIMES and not 0.0 <= number < math.inf:
            raise StageError(f"fault: got '{text}', expected a time in s that is not negative, e.g. {kind}=0.5")
        if kind == "error" and not number.is_integer():
            raise StageError(f"fault: got '{text}', expected the number of an error, e.g. {kind}={self.values[kind]:g}")
        return Fault(kind, command.upper(), at, number, kind in self.lasting)


class Faults:
    """Counts the commands of a device, and returns the faults that occur.

    Parameters
    ----------
    faults : iterable of Fault
    """

    def __init__(self, faults: Iterable[Fault] = ()) -> None:
        self._faults = tuple(faults)
        self._counts: dict[str, int] = {}
        self._active = {f.kind for f in self._faults if not f.command}

    def count(self, command: str) -> dict[str, float]:
        """Count a command, and return the kinds of the single faults that occur at it, with their values."""
        name = command.upper()
        count = self._counts[name] = self._counts.get(name, 0) + 1
        struck = [f for f in self._faults if f.command == name and f.occurrence == count]
        self._active |= {f.kind for f in struck if f.lasts}
        return {f.kind: f.value for f in struck if not f.lasts}

    def lasts(self, kind: str) -> bool:
        """Whether a lasting fault is present."""
        return kind in self._active
