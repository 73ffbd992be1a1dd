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

"""Phases of a long record: where the drive rests, steps and moves. The result is reported and can be overridden."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ...errors import RecordingError
from ...record import Experiment, Notice, Record, Samples
from .levels import LARGEST_NOISE, Piece, pieces_of
from .swing_shapes import turning_points
from .waveform import phase_name
from .waveform_changes import waveform_changes

_JUMP = 0.05
"""Length of the movements over that of the levels up to which the movements are jumps."""
_MOST = 100
"""Largest number of proposed phases."""


def labelled(
    parts: Sequence[Record], phases: str | Sequence[tuple[float, str]] | None
) -> tuple[list[Record], list[Notice]]:
    """Divide a record, or its parts between gaps, into phases.

    Parameters
    ----------
    parts : sequence of Record
        The parts of one recording.
    phases : str or sequence of (float, str) or None
        Name of the only phase; or time from the first sample [s] and name of every phase; or None for a proposal.

    Returns
    -------
    records : list of Record
        The phases; those divided here continue the phase before.
    notices : list of Notice
        The proposed names.

    Raises
    ------
    RecordingError
        If the times do not grow or leave no sample.
    """
    if isinstance(phases, str):
        return [replace(part, phase=phases) for part in parts], []
    if phases is not None:
        return _named(parts, phases), []
    records = []
    said = []
    for part in parts:
        proposal = propose(part.voltage, part.sample_period)
        cuts = part.split(*(start for start, _ in proposal[1:]))
        for cut, (start, name) in zip(cuts, proposal, strict=True):
            records.append(replace(cut, phase=name, initial_voltage=None if start else part.initial_voltage))
        said += [f"{name} from {part.start_time + start * part.sample_period:.6g} s" for start, name in proposal]
    more = f" and {len(said) - 12} more" if len(said) > 12 else ""
    return records, [Notice("proposed", f"the phases were named by their drive: {', '.join(said[:12])}{more}")]


def steps_named(experiment: Experiment) -> Experiment:
    """An experiment in which a proposed ``rest`` that begins with a step from another voltage is called ``step``."""
    notices = list(experiment.notices)
    records = list(experiment.records)
    span = max(float(np.ptp(np.append(r.voltage, r.settled_voltage))) for r in records)
    for i, record in enumerate(records):
        if record.phase != "rest" or record.continues or record.truncated:
            continue
        proposed = f"rest from {record.start_time:.6g} s"
        at = next((k for k, n in enumerate(notices) if n.kind == "proposed" and proposed in n.message), None)
        if at is None or abs(float(record.voltage[0]) - record.settled_voltage) <= LARGEST_NOISE * span:
            continue
        records[i] = replace(record, phase="step")
        notices[at] = replace(notices[at], message=notices[at].message.replace(proposed, f"step{proposed[4:]}", 1))
    return replace(experiment, records=tuple(records), notices=tuple(notices))


def _named(parts: Sequence[Record], phases: Sequence[tuple[float, str]]) -> list[Record]:
    times = [float(time) for time, _ in phases]
    if not times or any(not b > a for a, b in itertools.pairwise(times)):
        raise RecordingError(f"`phases`: got start times {times} s, expected growing ones")
    origin = parts[0].start_time
    records: list[Record] = []
    for part in parts:
        starts = [round((origin + time - part.start_time) / part.sample_period) for time in times]
        for (a, b), (_, name) in zip(itertools.pairwise([*starts, part.size]), phases, strict=True):
            if (start := max(a, 0)) < (stop := min(b, part.size)):
                piece = replace(part[start:stop], phase=name)
                if start and not records:  # samples before the first start time are left out
                    piece = replace(piece, continues=False, truncated=True)
                records.append(replace(piece, initial_voltage=None) if start else piece)
    if not records:
        raise RecordingError(
            f"`phases`: got start times {times} s, expected some before {parts[-1].time[-1] - origin:g} s"
        )
    return records


def propose(voltage: Samples, sample_period: float) -> list[tuple[int, str]]:
    """First sample and name of every phase of a long drive signal.

    Parameters
    ----------
    voltage : (n,) ndarray
        Drive [V].
    sample_period : float
        Time between samples [s].

    Returns
    -------
    list of (int, str)
        The first one starts at sample 0. Constant drive is ``rest`` at the first level and ``hold`` at others; levels
        with transitions between them are ``step``, ``steps`` (two levels), ``staircase``, ``ramp`` or ``trapezoid``.
        A movement is cut where its waveform changes.
    """
    pieces = pieces_of(voltage)
    proposal: list[tuple[int, str]] = []
    first_level = pieces[0].level
    i = 0
    while i < len(pieces):
        piece = pieces[i]
        end = _chain_end(pieces, i, voltage)
        if end > i:
            lead = min(pieces[i - 1].size // 2, pieces[i + 1].size) if i else 0
            proposal.append((piece.start - lead, _levels(pieces[max(i - 1, 0) : end], voltage)))
            i = end
            continue
        if piece.moves:
            proposal += _movement(voltage[piece.start : piece.stop], piece.start, sample_period)
        else:
            near = abs(piece.level - first_level) <= LARGEST_NOISE * np.ptp(voltage)
            proposal.append((piece.start, "rest" if near else "hold"))
        i += 1
    if len(proposal) > _MOST:
        return [(0, phase_name(voltage, sample_period))]
    return [(0, proposal[0][1]), *proposal[1:]]


def _movement(voltage: Samples, start: int, sample_period: float) -> list[tuple[int, str]]:
    """First sample and name of every waveform of a movement that begins at `start`."""
    edges = [0, *waveform_changes(voltage), voltage.size]
    return [(start + a, phase_name(voltage[a:b], sample_period)) for a, b in itertools.pairwise(edges)]


def _chain_end(pieces: list[Piece], i: int, voltage: Samples) -> int:
    """Index after the last piece of the sequence movement, level, movement, level … that begins at `i`."""
    while i + 1 < len(pieces) and pieces[i].moves and _monotone(voltage, pieces[i]):
        i += 2
    return i


def _monotone(voltage: Samples, piece: Piece) -> bool:
    way = voltage[max(piece.start - 1, 0) : piece.stop + 1]
    span = float(np.ptp(way))
    return abs(float(way[-1] - way[0])) >= 0.95 * span and turning_points(way, 0.05 * span).size <= 2


def _levels(pieces: list[Piece], voltage: Samples) -> str:
    """Name of levels with transitions between them."""
    levels = [piece for piece in pieces if not piece.moves]
    moves = [piece for piece in pieces if piece.moves]
    if np.median([m.size for m in moves]) > max(2, _JUMP * np.median([p.size for p in levels])):
        return "trapezoid" if len(moves) > 1 else "ramp"
    if len(moves) == 1:
        return "step"
    near = 2 * LARGEST_NOISE * float(np.ptp(voltage))
    distinct = sorted(piece.level for piece in levels)
    return "steps" if sum(b - a > near for a, b in itertools.pairwise(distinct)) <= 1 else "staircase"
