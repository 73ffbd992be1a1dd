"""Phases of a long record: where the drive rests, steps, and moves, told and overridable."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..errors import RecordingError
from ..record import Notice, Record, Samples
from .waveform import phase_name, turning_points

_BLOCKS = 20_000
_SHORTEST = 4
_NOISE_WIDTH = 20.0
_LARGEST_NOISE = 0.02
_PEAK = 0.5
_JUMP = 0.05
_MOST = 100


def labelled(
    parts: Sequence[Record], phases: str | Sequence[tuple[float, str]] | None
) -> tuple[list[Record], list[Notice]]:
    """A record in one piece, or in the parts that its holes left, as phases.

    Parameters
    ----------
    parts : sequence of Record
        What was recorded in one go.
    phases : str or sequence of (float, str) or None
        Name of the only phase; or time from the first sample [s] and name of every phase; or None for a proposal.

    Returns
    -------
    records : list of Record
        Every piece; those cut off here continue the one before.
    notices : list of Notice
        What was proposed.

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
        records += [replace(cut, phase=name) for cut, (_, name) in zip(cuts, proposal, strict=True)]
        said += [f"{name} from {part.start_time + start * part.sample_period:.6g} s" for start, name in proposal]
    more = f" and {len(said) - 12} more" if len(said) > 12 else ""
    return records, [Notice("proposed", f"phases named by their drive: {', '.join(said[:12])}{more}")]


def _named(parts: Sequence[Record], phases: Sequence[tuple[float, str]]) -> list[Record]:
    times = [float(time) for time, _ in phases]
    if not times or any(not b > a for a, b in itertools.pairwise(times)):
        raise RecordingError(f"phases: got start times {times} s, expected growing ones")
    origin = parts[0].start_time
    records = []
    for part in parts:
        starts = [round((origin + time - part.start_time) / part.sample_period) for time in times]
        for (a, b), (_, name) in zip(itertools.pairwise([*starts, part.size]), phases, strict=True):
            if (start := max(a, 0)) < (stop := min(b, part.size)):
                records.append(replace(part[start:stop], phase=name))
    if not records:
        raise RecordingError(
            f"phases: got start times {times} s, expected some before {parts[-1].time[-1] - origin:g} s"
        )
    return records


@dataclass(frozen=True, slots=True)
class _Piece:
    start: int
    stop: int
    level: float = np.nan  # NaN where the drive moves

    @property
    def moves(self) -> bool:
        return self.level != self.level

    @property
    def size(self) -> int:
        return self.stop - self.start


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
    """
    pieces = _pieces(voltage)
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
            name = phase_name(voltage[piece.start : piece.stop], sample_period)
        else:
            near = abs(piece.level - first_level) <= _LARGEST_NOISE * np.ptp(voltage)
            name = "rest" if near else "hold"
        proposal.append((piece.start, name))
        i += 1
    if len(proposal) > _MOST:
        return [(0, phase_name(voltage, sample_period))]
    return [(0, proposal[0][1]), *proposal[1:]]


def _pieces(voltage: Samples) -> list[_Piece]:
    """Levels and the movements between them; the flat tops of a wave belong to the wave."""
    span = float(np.ptp(voltage))
    if span <= 1e-9 * float(np.abs(voltage).max()):
        return [_Piece(0, voltage.size, float(voltage[0]))]
    length = max(_SHORTEST, voltage.size // _BLOCKS)
    noise = float(np.quantile(np.std(_blocks(voltage, 4 * length), axis=1), 0.01))
    tolerance = min(max(_NOISE_WIDTH * noise, 1e-6 * span), _LARGEST_NOISE * span)
    length = max(length, int(voltage.size * tolerance / span))  # no drive is slower than once through its range
    levels = _joined(voltage, _levels_of(voltage, _blocks(voltage, length), length, tolerance), 4 * tolerance)
    turns = turning_points(voltage, max(4 * tolerance, 0.01 * span))
    levels = _without_peaks(levels, turns, voltage.size)
    pieces: list[_Piece] = []
    end = 0
    for level in levels:
        if level.start > 0:
            pieces.append(_Piece(end, level.start))  # of no size where the drive jumps
        pieces.append(level)
        end = level.stop
    if end < voltage.size:
        pieces.append(
            _Piece(
                end,
                voltage.size,
            )
        )
    return pieces


def _blocks(voltage: Samples, length: int) -> Samples:
    if voltage.size < length:
        return voltage[None, :]
    return voltage[: voltage.size // length * length].reshape(-1, length)


def _levels_of(voltage: Samples, blocks: Samples, length: int, tolerance: float) -> list[_Piece]:
    """Runs of blocks that stay within the tolerance, extended to the sample."""
    lows, highs = blocks.min(axis=1).tolist(), blocks.max(axis=1).tolist()
    found: list[_Piece] = []
    k = 0
    while k < len(lows):
        low, high, first = lows[k], highs[k], k
        while k + 1 < len(lows) and max(high, highs[k + 1]) - min(low, lows[k + 1]) <= tolerance:
            k += 1
            low, high = min(low, lows[k]), max(high, highs[k])
        k += 1
        if high - low > tolerance or k - first < 2:
            continue
        start, stop = first * length, min(k * length, voltage.size)
        middle = (low + high) / 2
        previous = found[-1].stop if found else 0
        before = np.abs(voltage[max(previous, start - length) : start][::-1] - middle) > tolerance
        after = np.abs(voltage[stop : stop + 2 * length] - middle) > tolerance
        start -= int(before.argmax()) if before.any() else before.size
        stop += int(after.argmax()) if after.any() else after.size
        found.append(_Piece(start, stop, float(voltage[start:stop].mean())))
        k = max(k, -(-stop // length))
    return found


def _joined(voltage: Samples, levels: list[_Piece], tolerance: float) -> list[_Piece]:
    """Levels with nothing but a level between them, as on the flat top of a wave."""
    joined: list[_Piece] = []
    for level in levels:
        if joined and float(np.ptp(voltage[joined[-1].stop - 1 : level.start + 1])) <= tolerance:
            start = joined.pop().start
            joined.append(_Piece(start, level.stop, float(voltage[start : level.stop].mean())))
        else:
            joined.append(level)
    return joined


def _without_peaks(levels: list[_Piece], turns: NDArray[np.int64], size: int) -> list[_Piece]:
    """Levels that are not short against the movements beside them, up to the next level or turning point."""
    kept = []
    for i, level in enumerate(levels):
        before = max(int(turns[turns < level.start - 1].max(initial=0)), levels[i - 1].stop if i else 0)
        after = min(
            int(turns[turns > level.stop].min(initial=size)), levels[i + 1].start if i + 1 < len(levels) else size
        )
        # a movement that the record cuts off says nothing about its length
        moves = [level.start - before] * (before > 0) + [after - level.stop] * (after < size - 1)
        if level.start == 0 or level.stop == size or level.size >= _PEAK * min(moves, default=0):
            kept.append(level)
    return kept


def _chain_end(pieces: list[_Piece], i: int, voltage: Samples) -> int:
    """One behind the last piece of the chain movement, level, movement, level … that begins at `i`."""
    while i + 1 < len(pieces) and pieces[i].moves and _monotone(voltage, pieces[i]):
        i += 2
    return i


def _monotone(voltage: Samples, piece: _Piece) -> bool:
    way = voltage[max(piece.start - 1, 0) : piece.stop + 1]
    span = float(np.ptp(way))
    return abs(float(way[-1] - way[0])) >= 0.95 * span and turning_points(way, 0.05 * span).size <= 2


def _levels(pieces: list[_Piece], voltage: Samples) -> str:
    """Name of levels with transitions between them."""
    levels = [piece for piece in pieces if not piece.moves]
    moves = [piece for piece in pieces if piece.moves]
    if np.median([m.size for m in moves]) > max(2, _JUMP * np.median([p.size for p in levels])):
        return "trapezoid" if len(moves) > 1 else "ramp"
    if len(moves) == 1:
        return "step"
    near = 2 * _LARGEST_NOISE * float(np.ptp(voltage))
    distinct = sorted(piece.level for piece in levels)
    return "steps" if sum(b - a > near for a, b in itertools.pairwise(distinct)) <= 1 else "staircase"
