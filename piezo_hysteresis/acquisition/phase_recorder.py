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

"""`record_phases`: plays waveforms to a stage one after the other, and returns their samples as records. No ROS."""

from __future__ import annotations

import queue
import time
from collections.abc import Callable, Iterable

import numpy as np

from ..channel_mapping import are_finite, quantity_of
from ..errors import PiezoError, StageError
from ..record import Record
from ..stage.stage import Samples
from .drive import EventKind
from .sample_block import Delivery, SampleBlock
from .session import DriverSession
from .streaming import StreamingAcquisition

SILENCE = 60.0
"""Time without a sample after which the recording fails [s]; twice the duration of the waveform is added."""


def record_phases(
    session: DriverSession,
    phases: Iterable[tuple[str, Samples, int]],
    progress: Callable[[str], None] = lambda name: None,
    keep: Callable[[list[Record]], None] = lambda records: None,
) -> tuple[Record, ...]:
    """Play and record phases, and bring the stage to its safe voltage at the end, also after an error.

    Parameters
    ----------
    session : DriverSession
        A session that has been opened and not started.
    phases : iterable of (str, (n,) ndarray, int)
        Name, drive voltage at the sample period of the session [V], and number of samples that are averaged into one.
    progress : callable
        Called with the name of each phase before it is played.
    keep : callable
        Called with the records of each phase as soon as the phase is complete.

    Returns
    -------
    tuple of Record
        One record per phase, or several if samples in it were not measured (while a device reads out its memory). Every
        record but the first continues the state of the stage.

    Raises
    ------
    PiezoError
        If the stage fails, or refuses a phase.
    """
    delivered: queue.SimpleQueue[Delivery | PiezoError] = queue.SimpleQueue()
    acquisition = session.start(
        node_clock=time.time_ns, deliver=delivered.put, fail=delivered.put, subscribers=lambda: 1
    )
    records: list[Record] = []
    try:
        while acquisition.playback.is_stopping:  # from the voltage at which another program has left the stage
            _next(delivered, SILENCE)
        for name, voltage, average in phases:
            progress(name)
            blocks = _played(session, acquisition, delivered, name, voltage)
            complete = _records(blocks, name, session.sample_period, average, bool(records))
            keep(complete)
            records += complete
    finally:
        session.make_safe()
    return tuple(records)


def _next(delivered: queue.SimpleQueue[Delivery | PiezoError], patience: float) -> Delivery:
    try:
        got = delivered.get(timeout=patience)
    except queue.Empty:
        raise StageError(f"no sample came for {patience:g} s, expected some; check the device") from None
    if isinstance(got, PiezoError):
        raise got
    return got


def _played(
    session: DriverSession,
    acquisition: StreamingAcquisition,
    delivered: queue.SimpleQueue[Delivery | PiezoError],
    name: str,
    voltage: Samples,
) -> list[SampleBlock]:
    """The blocks of one phase, without samples of other phases."""
    waveform = session.check.waveform(voltage, 0, 0)
    phase = acquisition.play(waveform, name, 0, session.check.first_step, lambda phase, size: None)
    patience = SILENCE + 2 * waveform.size * session.sample_period
    blocks: list[SampleBlock] = []
    while True:
        delivery = _next(delivered, patience)
        inside = np.flatnonzero(delivery.block.phase == phase.number)
        if inside.size:
            blocks.append(delivery.block.between(int(inside[0]), int(inside[-1]) + 1))
        for event in delivery.events:
            if event.phase.number == phase.number and event.kind is EventKind.DONE:
                return blocks
            if event.phase.number == phase.number and event.kind is EventKind.STOPPED:
                raise StageError(f"phase '{name}' was stopped; nothing was recorded")


def _records(blocks: list[SampleBlock], name: str, period: float, average: int, continues: bool) -> list[Record]:
    """The blocks of one phase as records, cut where samples were not measured."""
    pieces: list[list[SampleBlock]] = []
    for block in blocks:
        if pieces and not block.follows_gap:
            pieces[-1].append(block)
        else:
            pieces.append([block])
    records: list[Record] = []
    for piece in pieces:
        record = Record(
            np.concatenate([block.voltage for block in piece]),
            np.concatenate([block.displacement for block in piece]),
            period,
            name,
            start_time=int(piece[0].index[0]) * period,
            continues=continues or bool(records),
            channels=_further(piece),
        )
        records.append(record.decimate(average) if 1 < average <= record.size else record)
    return records


def _further(piece: list[SampleBlock]) -> dict[str, Samples]:
    """Channels that every block has and that a record can hold: finite, with a quantity in the name."""
    names = [n for n in piece[0].channels if quantity_of(n) and all(n in block.channels for block in piece)]
    channels = {name: np.concatenate([block.channels[name] for block in piece]) for name in names}
    return {name: values for name, values in channels.items() if are_finite(values)}
