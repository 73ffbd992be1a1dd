"""`Fault`: one way in which an emulated controller or its stage misbehaves, and when."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from ....errors import StageError

ONCE = {
    "link_lost": ("DRR?", "half the answer, then the link is closed"),
    "gone": ("DRR?", "half the answer, then the link is closed and no new one accepted"),
    "partial_answer": ("DRR?", "half the answer, then silence"),
    "slow": ("POS?", "the answer comes late, by the number of seconds given after '=' (5)"),
    "error": ("WAV", "refused with the error number given after '=' (17)"),
    "garbled": ("DRR?", "one value of the answer is no number"),
}
"""Faults that strike once: word -> (command they strike at unless told otherwise, what happens)."""

LASTING = {
    "short_record": "the recorder stops at four fifths of its waveform",
    "wrong_servo_time": "runs at twice the servo time that SPA? tells",
    "saturated": "the amplifier ends at half of the voltage range",
    "stale": "position readings stand still",
    "duplicated": "a block of recorded samples comes twice",
    "swapped": "the recorded channels are exchanged",
    "skewed": "recorded positions are one sample late",
    "servo_on": "the servo is on and cannot be switched off",
}
"""Faults that last, from the start or from a command on: word -> what happens."""

_DEFAULTS = {"slow": 5.0, "error": 17.0}


@dataclass(frozen=True, slots=True)
class Fault:
    """A fault and its trigger.

    Parameters
    ----------
    kind : str
        Key of `ONCE` or `LASTING`.
    command : str
        Mnemonic at which it strikes; empty for a lasting fault that is there from the start.
    occurrence : int
        Strikes when the command comes for the so-manieth time.
    value : float
        Seconds of ``slow``, number of ``error``.

    Examples
    --------
    >>> Fault.parse("slow@VOL?:2=0.5")
    Fault(kind='slow', command='VOL?', occurrence=2, value=0.5)
    """

    kind: str
    command: str = ""
    occurrence: int = 1
    value: float = 0.0

    @classmethod
    def parse(cls, text: str) -> Fault:
        """Read ``kind[@COMMAND[:occurrence]][=value]``.

        Raises
        ------
        StageError
            If the text is not of that form.
        """
        front, _, value = text.partition("=")
        kind, _, trigger = front.partition("@")
        command, _, occurrence = trigger.partition(":")
        if kind not in ONCE and kind not in LASTING:
            raise StageError(f"fault: got '{kind}', expected one of {', '.join((*ONCE, *LASTING))}")
        try:
            at, number = int(occurrence or 1), float(value) if value else _DEFAULTS.get(kind, 0.0)
        except ValueError:
            raise StageError(f"fault: got '{text}', expected kind@COMMAND:occurrence=value") from None
        return cls(kind, (command or ONCE.get(kind, ("",))[0]).upper(), at, number)


class Faults:
    """Faults in motion: counts commands and tells what strikes.

    Parameters
    ----------
    faults : iterable of Fault
    """

    def __init__(self, faults: Iterable[Fault] = ()) -> None:
        self._faults = tuple(faults)
        self._counts: dict[str, int] = {}
        self._active = {f.kind for f in self._faults if not f.command}

    def count(self, command: str) -> dict[str, float]:
        """Note a command; the kinds of the faults that strike once at it, with their values."""
        count = self._counts[command] = self._counts.get(command, 0) + 1
        struck = [f for f in self._faults if f.command == command and f.occurrence == count]
        self._active |= {f.kind for f in struck if f.kind in LASTING}
        return {f.kind: f.value for f in struck if f.kind in ONCE}

    def lasts(self, kind: str) -> bool:
        """True while a lasting fault is there."""
        return kind in self._active
