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

from collections.abc import Mapping, Sequence
from typing import Any

from numpy.typing import NDArray

from ...channel_mapping import axis_of
from ...errors import RecordingError
from ...record import Notice, Record
from ..segmentation.decimating_buffer import DecimatingBuffer, averaged_notice
from ..table.column_inference import (
    axis_columns,
    inference_notice,
    inferred_columns,
    inferred_period,
    named_column,
    period_of,
    require_different,
    unit_in,
    unit_of,
)
from ..table.read_options import CHANNELS, LABELS, ReadOptions, is_channel
from ..table.table import table_records
from .array_place import ArrayPlace, example, listed
from .named_arrays import NamedArrays


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
    places, inferred, period = _places(arrays, prefix, options)
    labels = {name: _label(arrays[place.name], str(place)) for name, place in places.items() if name in LABELS}
    if period is not None:
        labels["sample_period"] = repr(period)
    elif not ("time" in places or "sample_period" in labels or options.sample_period is not None):
        raise RecordingError(
            f"got {listed(arrays)}, expected times or one number that is called sample_period, dt, ts or fs; give "
            "`sample_period`"
        )
    channels = {c: place for c, place in places.items() if is_channel(c)}
    require_different({c: str(place) for c, place in channels.items()})
    titles = {c: str(place) if place.column else arrays.title(place.name) for c, place in channels.items()}
    units = {c: unit_of(title, c, options.units) for c, title in titles.items()}
    buffers = {c: _samples(arrays, place, options) for c, place in channels.items()}
    columns = {c: options.in_si(c, buffer.column(0), units[c]) for c, buffer in buffers.items()}
    needed, size = {*CHANNELS, *options.columns}, columns["voltage"].size
    columns = {c: values for c, values in columns.items() if c in needed or axis_of(c) or values.size == size}
    sizes = {name: values.size for name, values in columns.items()}
    if len(set(sizes.values())) > 1:
        raise RecordingError(f"got channels of {sizes} samples, expected equal lengths")
    average = buffers["voltage"].factor
    rest = options.after_reading(average)
    records, notices = table_records(columns, [(0, labels)], rest, before, truncated=options.passes_over)
    if options.average is None and average > 1:
        notices.append(averaged_notice(average, records[0].sample_period, labels.get("phase", "")))
    return records, [*notices, *inference_notice(inferred, units)]


def _places(
    arrays: NamedArrays, prefix: str, options: ReadOptions
) -> tuple[dict[str, ArrayPlace], dict[str, str], float | None]:
    """Place of every channel and label, the titles of those that were inferred, and an inferred sample period [s]."""
    places = {c: ArrayPlace.of(arrays, str(text), c) for c, text in options.columns.items()}
    used = {str(place) for place in places.values()}
    open_ = [c for c in CHANNELS if c not in places and prefix + c not in arrays]
    for field in (name.removeprefix(prefix) for name in arrays if name.startswith(prefix)):
        has_unit = any(field.startswith(f"{c}_") and unit_in(field, c) for c in open_) or _is_axis_with_unit(field)
        is_further = is_channel(field) and not has_unit and prefix + field not in used
        if field not in places and (field in CHANNELS or field in LABELS or is_further):
            places[field] = ArrayPlace(prefix + field)
    inferred, period = {}, None
    if options.sample_period is None and "sample_period" not in places and (found := _period(arrays, places)):
        inferred["sample_period"], period = found
    timed = options.sample_period is not None or "sample_period" in places or period is not None
    names = [name for name in arrays if name not in _names(places)]
    wanted = [c for c in ("time", "voltage", "displacement") if c not in places and not (c == "time" and timed)]
    titles = [arrays.title(name) for name in names]
    for channel, at in inferred_columns([title.rpartition(".")[2] for title in titles], (), wanted).items():
        places[channel], inferred[channel] = ArrayPlace(names[at]), titles[at]
    for channel in ("voltage", "displacement"):
        if channel not in places:
            hint = example(arrays, channel, _names(places))
            raise RecordingError(f"got {listed(arrays)}, expected {prefix}{channel}{hint}")
    group = places["voltage"].name.rpartition(".")[0]
    names = [name for name in arrays if name.rpartition(".")[0] == group and name not in _names(places)]
    titles = [arrays.title(name) for name in names]
    for channel, at in axis_columns([title.removeprefix(f"{group}.") for title in titles], ()).items():
        if channel not in places:
            places[channel], inferred[channel] = ArrayPlace(names[at]), titles[at]
    return places, inferred, period


def _names(places: Mapping[str, ArrayPlace]) -> set[str]:
    return {place.name for place in places.values()}


def _is_axis_with_unit(field: str) -> bool:
    name = named_column(field)[0]
    return name != field and axis_of(name) is not None


def _period(arrays: NamedArrays, places: Mapping[str, ArrayPlace]) -> tuple[str, float] | None:
    """Name of the first variable that is called like a sample period and holds one number, and the period [s]."""
    for name in arrays:
        if name not in _names(places) and (found := inferred_period([name])) and arrays[name].size == 1:
            return name, period_of(name, float(_label(arrays[name], name)), found[1])
    return None


def _samples(arrays: NamedArrays, place: ArrayPlace, options: ReadOptions) -> DecimatingBuffer:
    return arrays.samples(place.name, None if place.column is None else place.column - 1, options)


def _label(value: NDArray[Any], place: str) -> str:
    if value.size != 1 or value.dtype.kind not in "Ufiub":
        raise RecordingError(f"{place}: got {value.dtype} of shape {value.shape}, expected one text or number")
    item = value.reshape(()).item()
    return str(int(item)) if isinstance(item, bool) else str(item)
