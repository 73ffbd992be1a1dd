"""`RecordedPlayback`: the phases of a replayed experiment, in place of commanded ones. No ROS."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from ..errors import StageError
from ..record import Record
from .drive import Drive, Event, EventKind, Phase


class RecordedPlayback:
    """What `Playback` is to a stage that can be driven, for one that replays records.

    Parameters
    ----------
    records : iterable of Record
        In the order in which the stage plays them.
    repeat : bool
        Begin again after the last one; otherwise a phase ``hold`` follows.
    """

    is_playing = is_stopping = False
    is_safe = True

    def __init__(self, records: Iterable[Record], repeat: bool = False) -> None:
        self._records = tuple(records)
        self._repeat = repeat
        self._next = 0
        self._left: float = 0
        self.phase = Phase(0, "idle")
        self.voltage = float(self._records[0].voltage[0])

    def take(self, count: int) -> Drive:
        """Labels of the next `count` samples; the voltages are for a stage that ignores them."""
        phase = np.empty(count, np.uint32)
        events: list[Event] = []
        at = 0
        while at < count:
            if not self._left:
                self._open()
                events.append(Event(at, EventKind.BEGAN, self.phase))
            stretch = int(min(count - at, self._left))
            phase[at : at + stretch] = self.phase.number
            self._left -= stretch
            at += stretch
        return Drive(np.full(count, self.voltage), phase, tuple(events))

    def _open(self) -> None:
        if self._repeat:
            self._next %= len(self._records)
        ended = self._next == len(self._records)
        name = "hold" if ended else self._records[self._next].phase
        self._left = float("inf") if ended else self._records[self._next].size
        self.phase = Phase(self.phase.number + 1, name)
        self._next += 1

    def require_free(self, name: str) -> None:
        """StageError: it never is."""
        raise StageError(f"{name}: a recording is replayed and cannot be driven")

    def play(self, waveform: object, name: str, stamp: int = 0) -> Phase:
        """Refused."""
        self.require_free(name)
        return self.phase

    def ramp_to(self, voltage: float) -> None:
        """Refused."""
        self.require_free("set_voltage")

    def stop(self) -> Phase:
        """Nothing is energised."""
        return self.phase
