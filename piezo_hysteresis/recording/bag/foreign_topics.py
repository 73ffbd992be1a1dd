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

"""Voltage and displacement from topics of other software, named as ``/topic.field[element]``."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from ...errors import RecordingError
from ...record import Notice, Record, Samples
from ..checks.split_at_gaps import split_at_gaps
from ..segmentation.decimating_buffer import PIECE, DecimatingBuffer, averaged_notice
from ..segmentation.phases import labelled
from ..table.column import Column
from ..table.read_options import ReadOptions, is_channel
from ..table.time_column import TimeColumn
from .bag import Bag

_PLACE = re.compile(r"(?P<topic>/[^.\[\]]+)(\.(?P<fields>[\w.]+))?(\[(?P<element>\d{1,9})\])?")
"""Form of the place of a channel: ``/topic.field[element]``."""


class TopicField(NamedTuple):
    """The place of a channel in a bag."""

    topic: str
    fields: tuple[str, ...]
    element: int | None

    @classmethod
    def parse(cls, text: str) -> TopicField:
        """``"/sensor.position[1]"``: topic, field (default `data`) and element, counted from 0 as in ROS.

        >>> TopicField.parse("/sensor.position[1]")
        TopicField(topic='/sensor', fields=('position',), element=1)
        """
        match = _PLACE.fullmatch(text)
        if match is None:
            raise RecordingError(f"`columns`: got '{text}', expected /topic.field or /topic.field[element]")
        element = match["element"]
        return cls(match["topic"], tuple((match["fields"] or "data").split(".")), int(element) if element else None)

    def value(self, message: Any) -> NDArray[np.float64]:
        """The numbers at this place of a message, as a one-dimensional array."""
        for name in self.fields:
            message = getattr(message, name)
        values = np.atleast_1d(np.asarray(message, np.float64))
        return values.ravel() if self.element is None else values.ravel()[self.element : self.element + 1]


@dataclass
class _Series:
    """Values of one channel and the time of the message of each."""

    times: Column = field(default_factory=partial(Column, np.float64))
    values: Column = field(default_factory=partial(Column, np.float64))

    def add(self, time: float, values: NDArray[np.float64], period: float) -> None:
        self.times.extend(np.asarray(time + period * np.arange(values.size)))
        self.values.extend(values)

    def arrays(self) -> tuple[Samples, Samples]:
        return self.times.array(), self.values.array()


def read_topics(bag: Bag, options: ReadOptions) -> tuple[list[Record], list[Notice]]:
    """The record that `ReadOptions.columns` describes.

    The samples are those of the displacement's topic. A channel of another topic has its newest value at each of them,
    because a drive is held between its messages. Times are the stamps in the headers, or the times of reception where
    there are none. A message may carry an array of samples; then `ReadOptions.sample_period` is needed.

    Raises
    ------
    RecordingError
        If a topic or field does not exist, or voltage or displacement is not mapped.
    """
    places = {
        name: TopicField.parse(str(text))
        for name, text in options.columns.items()
        if is_channel(name) and name != "time"
    }
    if not {"voltage", "displacement"} <= places.keys():
        raise RecordingError(f"`columns`: got {', '.join(options.columns)}, expected voltage and displacement")
    series, stamped = _series(bag, places, options.sample_period or 0.0)
    buffer = _paired(series, places, options)
    channels = {name: options.in_si(name, buffer.column(at)) for at, name in enumerate(series, 1)}
    held = len({p.topic for p in places.values()}) > 1
    truncated = bool(options.rows and options.rows[0]) and options.initial_voltage is None
    records, notices = _records(
        channels, buffer.column(0), held, stamped, options.after_reading(buffer.factor), truncated
    )
    if options.average is None and buffer.factor > 1:
        notices.append(averaged_notice(buffer.factor, records[0].sample_period))
    return records, notices


def _paired(series: dict[str, _Series], places: dict[str, TopicField], options: ReadOptions) -> DecimatingBuffer:
    """The times of the displacement, and the newest value of every channel then, in columns."""
    arrays = {name: own.arrays() for name, own in series.items()}
    time = arrays["displacement"][0]
    begun = max(float(times[0]) for times, _ in arrays.values())
    buffer = DecimatingBuffer.of(1 + len(arrays), options)
    for first in range(0, time.size, PIECE):
        part = np.arange(first, min(first + PIECE, time.size))
        part = part[time[part] >= begun]
        columns = [time[part]]
        for name, (times, values) in arrays.items():
            same = places[name].topic == places["displacement"].topic and values.size == time.size
            columns.append(values[part if same else np.searchsorted(times, time[part], "right") - 1])
        buffer.add(np.stack(columns, axis=1))
    return buffer


def _series(bag: Bag, places: dict[str, TopicField], period: float) -> tuple[dict[str, _Series], bool]:
    store = get_typestore(Stores.ROS2_KILTED)
    series = {name: _Series() for name in places}
    seen: set[str] = set()
    origin: int | None = None
    stamped = True
    for message in bag.in_time_order({place.topic for place in places.values()}):
        if message.type not in store.types and message.type in bag.definitions:
            store.register(get_types_from_msg(bag.definitions[message.type], message.type))
        content: Any = store.deserialize_cdr(message.raw, message.type)
        stamp = getattr(getattr(content, "header", None), "stamp", None)
        time_ns = int(stamp.sec) * 1_000_000_000 + int(stamp.nanosec) if stamp is not None else 0
        stamped = stamped and time_ns > 0
        origin = (time_ns or message.time_ns) if origin is None else origin
        for name, place in places.items():
            if place.topic == message.topic:
                try:
                    values = place.value(content)
                except (AttributeError, TypeError, ValueError):
                    raise RecordingError(
                        f"`columns`: {message.type} on {place.topic} has no numbers at '{'.'.join(place.fields)}'"
                    ) from None
                if values.size > 1 and not period:
                    raise RecordingError(f"{place.topic} carries {values.size} samples a message; give `sample_period`")
                series[name].add(((time_ns or message.time_ns) - origin) * 1e-9, values, period)
                seen.add(name)
    missing = [places[name].topic for name in places if name not in seen]
    if missing:
        raise RecordingError(f"got no message on {', '.join(missing)}; `ros2 bag info` lists the topics")
    return series, stamped


def _records(
    channels: dict[str, Samples], time: Samples, held: bool, stamped: bool, options: ReadOptions, truncated: bool
) -> tuple[list[Record], list[Notice]]:
    if time.size < 2:
        raise RecordingError(f"got {time.size} samples after the first value of every channel, expected two or more")
    part = options.part(time.size)
    channels = {name: values[part] for name, values in channels.items()}
    base = TimeColumn.of(time[part])
    notices = base.notices()
    if held:
        notices.append(
            Notice(
                "held", "the channels are on different topics; every sample takes the newest value of the other channel"
            )
        )
    if not stamped:
        notices.append(Notice("time_base", "the messages have no time stamps; their times of reception are used"))
    parts, more_notices = split_at_gaps(channels, options.sample_period or base.period, *base.gaps, truncated=truncated)
    records, proposed = labelled(parts, options.phases)
    return records, [*notices, *more_notices, *proposed]
