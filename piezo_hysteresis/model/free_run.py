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

"""Free run of a model over the records of an experiment; the state continues from record to record."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Iterator, Sequence
from typing import TYPE_CHECKING, cast

import numpy as np
from numpy.typing import NDArray

from ..errors import ModelError, UnknownStateWarning
from ..record import Record
from .chain import Chain, ChainState, ChainTangent
from .samples import samples

if TYPE_CHECKING:
    from .model import Model

Array = NDArray[np.float64]

HOLD_STEPS = 8
"""Number of steps over a long time between two records that continue."""

SHORT_GAP = 0.1
"""Longest time between two records that continue [s] during which the dynamics still move: it is run sample by sample.
"""


def free_run(model: Model, records: Iterable[Record]) -> list[Array]:
    """Displacement [m] of every record; what `Model.simulate` returns."""
    outputs: list[Array] = []
    state: ChainState | None = None
    chain: Chain | None = None
    for index, record in _with_holds(records):
        before, chain = chain, model.at(record.sample_period, chain.setting.sample_period if chain else None)
        if state is None or not record.continues:
            state = chain.rest(record.settled_voltage, record.start_time)
        elif before is not chain:
            state = chain.resume(state)
        y, state = chain.run(record.voltage, state, record.channels)
        if index is not None:
            outputs.append(y)
    return outputs


def simulated(
    model: Model,
    given: Record | Iterable[Record] | Array | Sequence[float],
    phase: str | None,
    sample_period: float | None = None,
) -> list[Array] | Array:
    """What `Model.simulate` returns: displacement [m] of the records of one phase, or of a voltage from rest."""
    if _is_voltage(given):
        voltage = samples(cast(Array, given), "voltage")
        return model.run(voltage, model.rest(voltage[0], sample_period=sample_period))[0]
    records = [given] if isinstance(given, Record) else list(cast(Iterable[Record], given))
    wanted = [i for i, r in enumerate(records) if phase is None or r.is_named(phase)]
    if phase is not None and not wanted:
        held = ", ".join(dict.fromkeys(r.phase for r in records)) or "no record"
        raise ModelError(f"phase: got {phase!r}, expected one of {held}")
    if records and (records[0].continues or records[0].truncated):
        warnings.warn(
            f"record '{records[0].phase}' continues one that was not given; it is simulated from rest at "
            f"{records[0].settled_voltage:g} V and is wrong at first; give the whole experiment and phase='…'",
            UnknownStateWarning,
            stacklevel=3,
        )
    outputs = free_run(model, records)
    return [outputs[i] for i in wanted]


def _is_voltage(given: object) -> bool:
    return isinstance(given, np.ndarray) or (isinstance(given, list | tuple) and all(np.isscalar(x) for x in given[:1]))


def linearised_run(
    model: Model, records: Iterable[Record], wanted: frozenset[str], block: int
) -> Iterator[tuple[int, slice, Array, tuple[str, ...], Array]]:
    """Displacement [m] and its sensitivities, block by block; what `Model.linearise` yields."""
    state: ChainState | None = None
    tangent: ChainTangent | None = None
    chain: Chain | None = None
    for stretch in _stretches(records):
        first = stretch[0][1]
        before, chain = chain, model.at(first.sample_period, chain.setting.sample_period if chain else None)
        if state is None or tangent is None or not first.continues:
            state = chain.rest(first.settled_voltage, first.start_time)
            tangent = chain.rest_tangent(first.settled_voltage, wanted, first.start_time)
        elif before is not chain:
            tangent = chain.resume_tangent(state, tangent)
            state = chain.resume(state)
        for start in range(0, sum(r.size for _, r in stretch), block):
            inside = list(_within(stretch, start, start + block))
            u = np.concatenate([r.voltage[part] for _, r, part in inside])
            used = chain.channels & first.channels.keys()
            now = {name: np.concatenate([r.channels[name][part] for _, r, part in inside]) for name in used}
            y, names, slopes, state, tangent = chain.linearise(u, state, tangent, wanted, now)
            done = 0
            for index, _, part in inside:
                own = slice(done, done + part.stop - part.start)
                done = own.stop
                if index is not None:
                    yield index, part, y[own], names, slopes[:, own]


def standard_errors(model: Model, records: Iterable[Record]) -> list[Array]:
    """Standard error of the displacement of every record [m]; what `Model.standard_errors` returns."""
    known = model.covariance
    if known is None:
        raise ModelError(
            "standard errors: got a model without the covariance of its numbers, expected one that was fitted; "
            "identify it again, its model file then states them"
        )
    records = list(records)
    found = [np.empty(record.size) for record in records]
    means = [np.zeros((1, 1)) for _ in records]
    for index, _, _, _, slopes in model.linearise(records, known.names):
        means[index] = means[index] + slopes.sum(axis=1, keepdims=True) / records[index].size
    for index, part, _, names, slopes in model.linearise(records, known.names):
        found[index][part] = known.errors_with(names, slopes - means[index])
    return found


def held_drive(voltage: float, duration: float, sample_period: float) -> tuple[float, Array]:
    """Sample period [s] and voltages [V] of a hold [s] after samples of a period: if it is long, a few long samples."""
    steps = round(duration / sample_period)
    if steps > HOLD_STEPS and duration > SHORT_GAP:
        steps, sample_period = HOLD_STEPS, duration / HOLD_STEPS
    return sample_period, np.full(steps, voltage)


def after_hold(model: Model, state: ChainState, voltage: float, duration: float) -> ChainState:
    """State after a further time [s] at the voltage [V] that is held."""
    period, held = held_drive(voltage, duration, state.sample_period)
    slow = model.at(period)
    return model.at(state.sample_period).resume(slow.run(held, slow.resume(state))[1])


def _with_holds(records: Iterable[Record]) -> Iterator[tuple[int | None, Record]]:
    """Records with their index, and without an index the holds between them, during which the stage moves on."""
    before: Record | None = None
    for index, record in enumerate(records):
        if before is not None and record.continues:
            end = before.start_time + before.duration
            period, held = held_drive(before.voltage[-1], max(0.0, record.start_time - end), before.sample_period)
            if held.size:
                yield None, Record(held, held, period, "hold", start_time=end, continues=True)
        yield index, record
        before = record


_Stretch = list[tuple[int | None, Record]]
"""Records that continue one another at one sample period, each with its index; the holds between them have None."""


def _stretches(records: Iterable[Record]) -> Iterator[_Stretch]:
    """Records in the longest stretches that can be simulated in one go."""
    found: _Stretch = []
    for index, record in _with_holds(records):
        if found:
            last = found[-1][1]
            alike = record.sample_period == last.sample_period and record.channels.keys() == last.channels.keys()
            if not (record.continues and alike):
                yield found
                found = []
        found.append((index, record))
    if found:
        yield found


def _within(stretch: _Stretch, start: int, stop: int) -> Iterator[tuple[int | None, Record, slice]]:
    """The parts of the records of a stretch that are from sample `start` up to `stop` of it."""
    begin = 0
    for index, record in stretch:
        part = slice(max(start - begin, 0), min(stop - begin, record.size))
        if part.start < part.stop:
            yield index, record, part
        begin += record.size
