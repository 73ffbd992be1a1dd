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

"""Makes an experiment from columns of numbers and labels."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from ...channel_mapping import QUANTITIES
from ...errors import RecordingError
from ...record import Notice, Record, Samples
from ..checks.split_at_gaps import split_at_gaps
from ..segmentation.phases import labelled
from .column_inference import (
    axis_columns,
    inference_notice,
    inferred_columns,
    named_column,
    require_different,
    unit_of,
)
from .read_options import CHANNELS, LABELS, ReadOptions, is_channel
from .time_column import TimeColumn, without_duplicates

Mark = tuple[int, Mapping[str, str]]
"""First row of a record and its labels."""


@dataclass(frozen=True, slots=True)
class Places:
    """Places of the channels of a table.

    Parameters
    ----------
    columns : dict of str to (int, str or None)
        Channel or label to its column, counted from 0, and the unit that its title names.
    notices : tuple of Notice
        Findings about inferred columns.
    """

    columns: dict[str, tuple[int, str | None]]
    notices: tuple[Notice, ...]


def resolve(titles: Sequence[str], width: int, options: ReadOptions) -> Places:
    """Find every channel and label of a table.

    Parameters
    ----------
    titles : sequence of str
        Column titles; empty where there are none.
    width : int
        Number of columns.
    options : ReadOptions
        Its `columns` have priority over the titles.

    Raises
    ------
    RecordingError
        If voltage or displacement is not found, or a named column does not exist.
    """
    parsed = [named_column(title) for title in titles]
    places: dict[str, tuple[int, str | None]] = {}
    for at, (name, unit) in enumerate(parsed):
        if (name in CHANNELS or name in LABELS or _is_further(titles[at], name)) and name not in places:
            places[name] = (at, unit)
    chosen: dict[str, tuple[int, str | None]] = {}
    for channel, column in options.columns.items():
        if isinstance(column, int):
            at = column - 1
        else:
            matches = [i for i, title in enumerate(titles) if column in (title.strip(), parsed[i][0])]
            at = matches[0] if matches else width
        if at >= width:
            raise RecordingError(f"`columns`: got {column!r} for {channel}, expected {_listed(titles, width)}")
        chosen[channel] = (at, unit_of(titles[at], channel, options.units) if titles else None)
    used = {at for at, _ in chosen.values()}
    places = {c: p for c, p in places.items() if c in (*CHANNELS, *LABELS) or p[0] not in used} | chosen
    open_ = [c for c in ("time", "voltage", "displacement") if c not in places]
    if "time" in open_ and options.sample_period is not None:
        open_.remove("time")  # an inferred column must not contradict the others
    found = inferred_columns(titles, (at for at, _ in places.values()), open_)
    places |= {channel: (at, unit_of(titles[at], channel, options.units)) for channel, at in found.items()}
    for channel in ("voltage", "displacement"):
        if channel not in places:
            taken = {at for at, _ in places.values()}
            free = next((at for at in range(1, width) if at not in taken), 1) + 1
            raise RecordingError(
                f"got {_listed(titles, width)}, expected a column for {channel}; name it by `columns`, e.g. "
                f"{channel}={free}"
            )
    require_different({channel: at for channel, (at, _) in places.items() if is_channel(channel)})
    axes = axis_columns(titles, (at for at, _ in places.values()))
    places = {channel: (at, parsed[at][1]) for channel, at in axes.items()} | places
    by_title = {c: place for c, place in places.items() if is_channel(c) and c not in options.columns}
    names = {channel: titles[at].strip() for channel, (at, _) in by_title.items()} if found else {}
    return Places(places, inference_notice(names, {channel: unit for channel, (_, unit) in by_title.items()}))


def _is_further(title: str, name: str) -> bool:
    """True for a plain quantity, and for a title as this package writes it, ``displacement_3_m``."""
    return name in QUANTITIES or (title.strip().startswith(f"{name}_") and is_channel(name))


def _listed(titles: Sequence[str], width: int) -> str:
    if not titles:
        return f"{width} columns without titles"
    return "the columns " + ", ".join(f"{i} '{title}'" for i, title in enumerate(titles[:30], 1))


def table_records(
    columns: Mapping[str, Samples],
    marks: Sequence[Mark],
    options: ReadOptions,
    before: Sequence[Record] = (),
    *,
    truncated: bool = False,
) -> tuple[list[Record], list[Notice]]:
    """Records of a table.

    Parameters
    ----------
    columns : mapping of str to (n,) ndarray
        Channels in SI units, `time` among them where the table has it.
    marks : sequence of Mark
        First rows of the records, and their labels; empty for a table without labels.
    options : ReadOptions
        Its `rows`, `phases`, `sample_period` apply; its `average` has been applied.
    before : sequence of Record
        Records of earlier tables.
    truncated : bool
        True where rows before the first one were skipped.

    Returns
    -------
    records : list of Record
        A labelled record continues the one before if the table says so, or else if the time continues without a gap.
    notices : list of Notice

    Raises
    ------
    RecordingError, RecordError
        If there is no sample period, or no sample.
    """
    part = options.part(min(values.size for values in columns.values()))
    columns = {name: values[part] for name, values in columns.items()}
    size = part.stop - part.start
    marks = marks or [(0, {})]
    if options.phases is not None or not any("phase" in labels for _, labels in marks):
        records, notices = _segment(columns, marks[0][1], options, before)
        if truncated or options.truncates(part):
            records[0] = replace(records[0], truncated=True)
        named, more_notices = labelled(records, options.phases)
        return named, [*notices, *more_notices]
    starts = [max(row - part.start, 0) for row, _ in marks]
    records, notices = [], []
    for (a, b), (_, labels) in zip(itertools.pairwise([*starts, size]), marks, strict=True):
        if a < min(b, size):
            piece = {name: values[a : min(b, size)] for name, values in columns.items()}
            parts, more_notices = _segment(piece, labels, options, [*before, *records[-1:]])
            records += parts
            notices += more_notices
    if truncated or options.truncates(part):
        records[0] = replace(records[0], truncated=True)
    return records, notices


def _segment(
    columns: Mapping[str, Samples], labels: Mapping[str, str], options: ReadOptions, before: Sequence[Record]
) -> tuple[list[Record], list[Notice]]:
    phase = labels.get("phase") or "record"
    time = columns.get("time")
    labelled_period = _number(labels, "sample_period")
    period = options.sample_period or (labelled_period and labelled_period * (options.average or 1))
    notices: list[Notice] = []
    breaks: dict[int, int] = {}
    pauses: dict[int, int] = {}
    if time is not None and (time.size > 1 or period is None):
        columns, notices = without_duplicates(columns)
        base = TimeColumn.of(columns["time"])
        if options.sample_period is not None:
            base.require(options.sample_period)
        period = period or base.period
        breaks, pauses = base.gaps
        notices = [*(replace(n, phase=phase) for n in notices), *base.notices(phase)]
    if period is None:
        raise RecordingError("got no times and no sample period, expected either; give `sample_period`")
    end = before[-1].start_time + before[-1].duration if before else 0.0
    start = _number(labels, "start_time")
    if start is None:
        start = end if time is None else float(time[0])
    goes_on = abs(start - end) < 1.5 * period
    parts, more_notices = split_at_gaps(
        {name: values for name, values in columns.items() if name != "time"},
        period,
        breaks,
        pauses,
        phase=phase,
        start_time=start,
        continues=_flag(labels, "continues") if "continues" in labels else bool(before) and goes_on,
        truncated=_flag(labels, "truncated"),
        initial_voltage=_number(labels, "initial_voltage"),
    )
    return parts, [*notices, *more_notices]


def _flag(labels: Mapping[str, str], name: str) -> bool:
    return labels.get(name, "").strip().lower() in ("1", "1.0", "true", "yes")


def _number(labels: Mapping[str, str], name: str) -> float | None:
    text = labels.get(name, "").strip()
    try:
        return float(text) if text else None
    except ValueError:
        raise RecordingError(f"{name}: got '{text}', expected a number") from None
