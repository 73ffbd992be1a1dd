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

"""Records from files that hold arrays under names: MATLAB, HDF5, NumPy, TDMS."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any

from numpy.typing import NDArray

from ...errors import RecordingError
from ...record import Notice, Record
from ..segmentation.decimating_buffer import DecimatingBuffer, averaged_notice
from ..table.column_inference import (
    inference_notice,
    inferred_columns,
    inferred_period,
    period_of,
    require_different,
    unit_in,
)
from ..table.read_options import CHANNELS, LABELS, ReadOptions, is_channel
from ..table.table import table_records
from .named_arrays import NamedArrays

_PLACE = re.compile(r"(?P<name>[^\[\]]+?)(\[(?P<column>[1-9]\d{0,8})\])?")
"""Form of the place of a channel: ``name[column]``."""


def records_from_arrays(
    arrays: NamedArrays, prefix: str, options: ReadOptions, before: Sequence[Record] = ()
) -> tuple[list[Record], list[Notice]]:
    """Records from the named arrays of a file.

    Parameters
    ----------
    arrays : NamedArrays
        Name to array.
    prefix : str
        Beginning of the names of one record, e.g. ``"phase_01."``; empty for all.
    options : ReadOptions
        Its `columns` have priority over the names.
    before : sequence of Record
        Earlier records.

    Raises
    ------
    RecordingError, RecordError
        If voltage or displacement is not found, or they form no record.
    """
    fields = [name.removeprefix(prefix) for name in arrays if name.startswith(prefix)]
    open_ = [c for c in CHANNELS if c not in options.columns and prefix + c not in arrays]
    with_unit = {name for name in fields for c in open_ if name.startswith(f"{c}_") and unit_in(name, c)}
    others = [name for name in (*fields, *options.columns) if is_channel(name) and name not in with_unit]
    given = {c: str(options.columns.get(c, prefix + c)) for c in (*CHANNELS, *others, *LABELS)}
    places = {c: place for c, place in given.items() if c in options.columns or place in arrays}
    labels = {name: _label(arrays[places[name]], places[name]) for name in LABELS if name in places}
    if options.sample_period is None and "sample_period" not in places and (found := _period(arrays, places)):
        labels["sample_period"] = repr(found)
    timed = options.sample_period is not None or "sample_period" in labels
    names = [name for name in arrays if name not in places.values()]
    wanted = [c for c in ("time", "voltage", "displacement") if c not in places and not (c == "time" and timed)]
    titles = [arrays.title(name) for name in names]
    found_at = inferred_columns([title.rpartition(".")[2] for title in titles], (), wanted)
    places |= {c: names[at] for c, at in found_at.items()}
    for channel in ("voltage", "displacement"):
        if channel not in places:
            raise RecordingError(f"got {_listed(arrays)}, expected {given[channel]}; name it by `columns`")
    require_different({c: place for c, place in places.items() if is_channel(c)})
    units = {c: unit_in(arrays.title(p) if p in arrays else p, c) for c, p in places.items() if is_channel(c)}
    buffers = {c: _channel(arrays, places[c], options) for c in units}
    columns = {c: options.in_si(c, buffer.column(0), units[c]) for c, buffer in buffers.items()}
    needed = {*CHANNELS, *options.columns}
    columns = {c: v for c, v in columns.items() if c in needed or v.size == columns["voltage"].size}
    sizes = {name: values.size for name, values in columns.items()}
    if len(set(sizes.values())) > 1:
        raise RecordingError(f"got channels of {sizes} samples, expected equal lengths")
    average = buffers["voltage"].factor
    rest = options.after_reading(average)
    records, notices = table_records(columns, [(0, labels)], rest, before, truncated=options.passes_over)
    if options.average is None and average > 1:
        notices.append(averaged_notice(average, records[0].sample_period, labels.get("phase", "")))
    return records, [*notices, *inference_notice({c: titles[at] for c, at in found_at.items()}, units)]


def _period(arrays: NamedArrays, places: Mapping[str, str]) -> float | None:
    """Sample period [s] of the first variable that is called like one and holds one number."""
    for name in arrays:
        if name not in places.values() and (found := inferred_period([name])) and arrays[name].size == 1:
            return period_of(name, float(_label(arrays[name], name)), found[1])
    return None


def _channel(arrays: NamedArrays, place: str, options: ReadOptions) -> DecimatingBuffer:
    match = _PLACE.fullmatch(place)
    name, number = (match["name"], match["column"]) if match else (place, None)
    if name not in arrays:
        raise RecordingError(f"got {_listed(arrays)}, expected {place}")
    column = None if number is None else int(number) - 1
    return arrays.samples(name, column, options)


def _label(value: NDArray[Any], place: str) -> str:
    if value.size != 1 or value.dtype.kind not in "Ufiub":
        raise RecordingError(f"{place}: got {value.dtype} of shape {value.shape}, expected one text or number")
    item = value.reshape(()).item()
    return str(int(item)) if isinstance(item, bool) else str(item)


def _listed(arrays: NamedArrays) -> str:
    return f"{arrays.kind} " + ", ".join(list(arrays)[:30])
