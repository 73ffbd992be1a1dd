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

"""`joined`: makes one segment with the channels of all axes from the streams of several drivers."""

from __future__ import annotations

from collections.abc import Mapping
from functools import reduce

import numpy as np
from numpy.typing import NDArray

from ...channel_mapping import axes_of
from ...errors import RecordingError
from ...record import Notice, Samples
from ..segmentation.segment import Segment
from .sample_stream import PERIOD_TOLERANCE, SampleStream


def joined(streams: Mapping[str, SampleStream]) -> tuple[Segment, list[Notice]]:
    """Samples of the same time from every stream, with the axes in the order of the streams.

    The stamps of the first samples relate the streams, the running index counts from there.

    Parameters
    ----------
    streams : mapping of str to SampleStream
        By namespace.

    Returns
    -------
    segment : Segment
        From the first to the last time that all streams have; samples that one of them lost are missing.
    notices : list of Notice
        Findings about the streams.

    Raises
    ------
    RecordingError
        If the streams have different sample periods, or no sample of the same time.
    """
    notices: list[Notice] = []
    parts: dict[str, list[Segment]] = {}
    for name, stream in streams.items():
        parts[name], found = stream.segments(split_phases=False)
        notices += [Notice(notice.kind, f"{name}: {notice.message}", severe=notice.severe) for notice in found]
    first, *_ = parts
    period = parts[first][0].sample_period
    for name, segments in parts.items():
        for segment in segments:
            if abs(segment.sample_period / period - 1) > PERIOD_TOLERANCE:
                raise RecordingError(
                    f"{name}: got the sample period {segment.sample_period:g} s, expected {period:g} s as of {first}"
                )
    places = [_places(parts[name], period, (streams[name].begin_ns - streams[first].begin_ns) * 1e-9) for name in parts]
    common = reduce(np.intersect1d, places)
    if common.size == 0:
        raise RecordingError(f"{', '.join(parts)}: got no samples of the same time, expected drivers that run together")
    channels: dict[str, Samples] = {}
    was_driven = False
    for place, segments in zip(places, parts.values(), strict=True):
        _, kept, _ = np.intersect1d(place, common, return_indices=True)
        names = segments[0].channels.keys() - {"voltage", "displacement"}
        for quantity in ("voltage", "displacement"):
            for name in axes_of(names, quantity):
                values = np.concatenate([segment.channels[name] for segment in segments])
                number = sum(channel.startswith(quantity) for channel in channels) + 1
                channels[f"{quantity}_{number}" if number > 1 else quantity] = values[kept]
                was_driven |= quantity == "voltage" and bool(np.ptp(values[: kept[0] + 1]) > 0)
        was_driven |= segments[0].phase != 0
    steps = np.diff(common)
    breaks = {int(at) + 1: int(steps[at]) - 1 for at in np.flatnonzero(steps > 1)}
    received = parts[first][0].received_ns
    return Segment(channels, period, int(was_driven), 0.0, received, 0, breaks, {}, True), notices


def _places(segments: list[Segment], period: float, offset: float) -> NDArray[np.int64]:
    """Number of every sample on the time base of the first stream; `offset` is the time of the first sample [s]."""
    places = []
    for segment in segments:
        missing = np.zeros(segment.size, np.int64)
        for at, count in (*segment.breaks.items(), *segment.pauses.items()):
            missing[at:] += count if at else 0
        places.append(round((offset + segment.start_time) / period) + np.arange(segment.size) + missing)
    return np.concatenate(places)
