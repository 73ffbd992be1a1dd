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

"""Makes records from channels with gaps. Only short gaps in smooth channels are interpolated, which is reported."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...channel_mapping import axis_of
from ...errors import RecordError
from ...record import Notice, Record, Samples
from .short_gaps import Gap, filled, is_held, joined, with_missing_rows

SHORTEST_SHARE = 1 / 64
"""A piece between two gaps is kept if it is at least this share of the phase."""

_NEEDED = ("voltage", "displacement")
"""Channels without whose numbers a sample is lost."""
_ROW = "row"
"""Name of the row number beside the channels; it shows which samples were recorded."""

LARGEST = 1e30
"""Numbers beyond this count as damaged, in any unit [V, m]."""

PERIODS = (1e-9, 1e6)
"""Sample periods that a recording can have [s]."""


def segments(good: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Start and stop of every run of True.

    >>> segments(np.array([True, False, True, True]))
    [(0, 1), (2, 4)]
    """
    edges = np.flatnonzero(np.diff(good.astype(np.int8), prepend=0, append=0))
    return [(int(a), int(b)) for a, b in edges.reshape(-1, 2)]


def split_at_gaps(
    channels: Mapping[str, Samples],
    sample_period: float,
    breaks: Mapping[int, int] | None = None,
    pauses: Mapping[int, int] | None = None,
    **labels: Any,
) -> tuple[list[Record], list[Notice]]:
    """One phase as records without its non-finite and missing samples, except those that `short_gaps` interpolates.

    Parameters
    ----------
    channels : mapping of str to (n,) ndarray
        `voltage` [V] and `displacement` [m], NaN or infinite where nothing was measured; others, as in
        `Record.channels`, are left out where they have gaps.
    sample_period : float
        Time between samples [s].
    breaks : mapping of int to int, optional
        Sample before which others are missing, to their number.
    pauses : mapping of int to int, optional
        Sample before which others were never measured while the voltage was held, to their number.
    **labels
        The other fields of `Record`.

    Returns
    -------
    records : list of Record
        A record after a gap `continues` and is `truncated`, because its state is known only approximately. After a
        pause, or a short gap in which the voltage was held, it is not `truncated`. Where time decreases, it does not
        `continue`.
    notices : list of Notice
        What was dropped or interpolated.

    Raises
    ------
    RecordError
        On unequal channels or where no finite sample is left.
    """
    phase = str(labels.get("phase", "record"))
    voltage, displacement = channels["voltage"], channels["displacement"]
    if voltage.ndim != 1 or voltage.shape != displacement.shape or voltage.size == 0:
        return [Record(voltage, displacement, sample_period, **labels)], []  # raises the error for the channel
    for name, values in channels.items():
        if values.shape != voltage.shape:
            raise RecordError(f"{name}: got {values.size} samples, expected {voltage.size} as in voltage")
    if not PERIODS[0] <= sample_period <= PERIODS[1]:
        said = f"got a sample period of {sample_period:g} s, expected {PERIODS[0]:g} to {PERIODS[1]:g} s"
        raise RecordError(f"{said}; give it by `sample_period`")
    further, notices = _complete(channels, phase)
    given = {**{name: channels[name] for name in _NEEDED}, **further, _ROW: np.arange(float(voltage.size))}
    rows, breaks, pauses = with_missing_rows(given, breaks or {}, pauses or {})
    voltage, displacement = (np.where(np.abs(rows[c]) < LARGEST, rows[c], np.nan) for c in _NEEDED)
    further = {name: np.interp(np.arange(voltage.size), *_measured(rows[name])) for name in further}
    gaps = {**breaks, **pauses}
    edges = sorted(gaps.keys() - {0})
    begin = float(labels.pop("start_time", 0.0))
    missing = np.cumsum([0, *(gaps[e] for e in edges)])

    def time_of(sample: int) -> float:
        return begin + (sample + int(missing[np.searchsorted(edges, sample, "right")])) * sample_period

    lost = ~(np.isfinite(voltage) & np.isfinite(displacement))
    short = [gap for gap in joined(segments(lost)) if not _has_edge(gap, edges)]
    voltage, displacement, closed = filled(voltage, displacement, short)
    good = np.isfinite(voltage) & np.isfinite(displacement)
    found = [(a + i, a + j) for a, b in _between(edges, good.size) for i, j in segments(good[a:b])]
    if not found:
        raise RecordError(f"phase '{phase}': got no finite sample among {good.size}")
    shortest = min(SHORTEST_SHARE * good.size, max(b - a for a, b in found))
    known = {
        a
        for (begun, end), (a, _) in zip(found, found[1:], strict=False)
        if end - begun >= shortest
        and ((end == a and a in pauses) or is_held(voltage, (end, a), a - end + gaps.get(a, 0)))
    }
    pieces = [(a, b) for a, b in found if b - a >= shortest]
    notices += _dropped(np.isfinite(rows[_ROW]), good, pieces, phase)
    if closed:
        samples = sum(int(np.count_nonzero(lost[a:b])) for a, b in closed)
        at = ", ".join(f"{time_of(a):.6g} s" for a, _ in closed[:3]) + (", …" if len(closed) > 3 else "")
        text = f"{samples} lost samples were interpolated, because the channels are smooth there (at {at})"
        notices.append(Notice("interpolated", text, phase))
    records: list[Record] = []
    for a, b in pieces:
        if a > 0:
            labels |= {
                "continues": bool(records or labels.get("continues")) and breaks.get(a) != 0,
                "truncated": a not in known,
                "initial_voltage": None,
            }
        others = {name: values[a:b] for name, values in further.items()}
        records.append(
            Record(voltage[a:b], displacement[a:b], sample_period, start_time=time_of(a), channels=others, **labels)
        )
    return records, notices


def _complete(channels: Mapping[str, Samples], phase: str) -> tuple[dict[str, Samples], list[Notice]]:
    """The channels beside voltage and displacement that have no gap, and notices about the others."""
    complete, notices = dict[str, Samples](), list[Notice]()
    for name in (n for n in channels if n not in _NEEDED):
        if (np.abs(channels[name]) < LARGEST).all():
            complete[name] = channels[name]
        else:
            text = f"{name} has non-finite samples; the channel was left out"
            notices.append(Notice("non_finite", text, phase, severe=axis_of(name) is not None))
    return complete, notices


def _dropped(
    recorded: NDArray[np.bool_], good: NDArray[np.bool_], pieces: list[tuple[int, int]], phase: str
) -> Iterator[Notice]:
    """What was dropped of the samples that were recorded, and into how many pieces they were split."""
    dropped = int(np.count_nonzero(recorded)) - sum(int(np.count_nonzero(recorded[a:b])) for a, b in pieces)
    if bad := int(np.count_nonzero(recorded & ~good)):
        text = f"{bad} of {good.size} samples are not finite and were dropped"
        yield Notice("non_finite", text, phase, severe=bad > good.size // 2)
    if dropped > bad:
        text = f"{dropped - bad} samples between closely spaced gaps were dropped"
        yield Notice("split", text, phase, severe=dropped > good.size // 2)
    if len(pieces) > 1:
        yield Notice("split", f"the phase was split at its gaps into {len(pieces)} records", phase)


def _between(edges: list[int], size: int) -> list[tuple[int, int]]:
    return list(zip([0, *edges], [*edges, size], strict=True))


def _has_edge(gap: Gap, edges: list[int]) -> bool:
    """Whether a break or a pause lies in or at a gap."""
    k = bisect_left(edges, gap[0])
    return k < len(edges) and edges[k] <= gap[1]


def _measured(values: Samples) -> tuple[Samples, Samples]:
    """Places and values of the finite samples."""
    places = np.flatnonzero(np.isfinite(values))
    return places.astype(np.float64), values[places]
