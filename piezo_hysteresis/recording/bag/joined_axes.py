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

"""`JoinedAxes`: makes one segment with the channels of all axes from the messages of several drivers."""

from __future__ import annotations

from collections.abc import Sequence
from functools import reduce

import numpy as np
from numpy.typing import NDArray

from ...channel_mapping import axes_of
from ...errors import RecordingError
from ...record import Samples
from ..segmentation.segment import Segment
from ..table.column import Column
from ..table.time_column import round_period
from .block_message import BlockMessage

PERIOD_TOLERANCE = 1e-3
"""Largest relative difference of two sample periods."""

LARGEST_SKEW = 2e-3
"""Change of the stamps of a driver against its index above which samples cannot be joined [s]; at least a sample."""


class JoinedAxes:
    """Collects the blocks of several drivers that run together.

    Parameters
    ----------
    axes : sequence of str
        Namespaces in the order of the axes.
    sample_period : float, optional
        Sample period [s] that replaces the times in the blocks.
    """

    def __init__(self, axes: Sequence[str], sample_period: float | None = None) -> None:
        self._axes = {axis: _Axis(axis, sample_period) for axis in axes}

    def add(self, axis: str, block: BlockMessage) -> None:
        """Append a block of one driver."""
        self._axes[axis].add(block)

    @property
    def absent(self) -> list[str]:
        """Namespaces of which no sample was read."""
        return [name for name, axis in self._axes.items() if not axis.places]

    def segment(self, received_ns: int) -> Segment:
        """Samples of the same time from every driver; those that one of them lost are missing.

        Parameters
        ----------
        received_ns : int
            Time at which the first block was received [ns].

        Raises
        ------
        RecordingError
            If the drivers have different sample periods, stamps that contradict the index, or no sample of the same
            time.
        """
        axes = list(self._axes.values())
        period, begin = axes[0].period, axes[0].begin(axes[0].period)
        for axis in axes[1:]:
            if abs(axis.period / period - 1) > PERIOD_TOLERANCE:
                raise RecordingError(
                    f"{axis.name}: got the sample period {axis.period:g} s, expected {period:g} s as of {axes[0].name}"
                )
        kept = [axis.numbers + round((axis.begin(period) - begin) * 1e-9 / period) for axis in axes]
        common = reduce(np.intersect1d, kept)
        if common.size == 0:
            raise RecordingError(
                f"{', '.join(self._axes)}: got no samples of the same time, expected drivers that run together"
            )
        channels: dict[str, Samples] = {}
        was_driven = False
        for axis, numbers in zip(axes, kept, strict=True):
            _, first, _ = np.intersect1d(numbers, common, return_indices=True)
            values = axis.channels
            for quantity in ("voltage", "displacement"):
                for name in axes_of(values, quantity):
                    number = sum(channel.startswith(quantity) for channel in channels) + 1
                    channels[f"{quantity}_{number}" if number > 1 else quantity] = values[name][first]
            was_driven |= axis.was_driven(numbers, int(common[0]))
        steps = np.diff(common)
        holes = {int(at) + 1: int(steps[at]) - 1 for at in np.flatnonzero(steps > 1)}
        pauses = set.intersection(*({int(n[at]) for at in a.paused} for a, n in zip(axes, kept, strict=True)))

        def is_pause(at: int) -> bool:
            """Whether all drivers announced the hole before sample `at`, and none measured in it."""
            inside = (((n > common[at - 1]) & (n < common[at])).any() for n in kept)
            return int(common[at]) in pauses and not any(inside)

        paused = {at: count for at, count in holes.items() if is_pause(at)}
        breaks = {at: count for at, count in holes.items() if at not in paused}
        return Segment(channels, period, int(was_driven), 0.0, received_ns, 0, breaks, paused, True)


class _Axis:
    """The blocks of one driver in order of arrival."""

    def __init__(self, name: str, sample_period: float | None) -> None:
        self.name, self._given = name, sample_period
        self._channels: dict[str, Column] = {}
        self._index, self._phase = Column(np.uint32), Column(np.uint32)
        self.places: list[int] = []
        self.paused: list[int] = []
        self._times_ns: list[int] = []
        self._periods: list[float] = []

    def add(self, block: BlockMessage) -> None:
        begin, n = len(self._index), block.phase.size
        names = {name for quantity in ("voltage", "displacement") for name in axes_of(block.channels, quantity)}
        if not self._channels:
            self._channels = {name: Column(np.float64) for name in sorted(names)}
        if names != self._channels.keys() or block.index is None or block.time is None:
            raise RecordingError(
                f"{self.name}: got a block with {', '.join(sorted(names))}, expected time, index and "
                f"{', '.join(self._channels)} in every block"
            )
        for name, column in self._channels.items():
            column.extend(block.channels[name])
        self._index.extend(block.index)
        self._phase.extend(block.phase)
        self.places.append(begin)
        if block.follows_pause:
            self.paused.append(begin)
        self._times_ns.append(block.stamp_ns + round(float(block.time[0]) * 1e9))
        if n > 1:
            self._periods.append(float(block.time[-1] - block.time[0]) / (n - 1))

    @property
    def period(self) -> float:
        """Sample period [s]."""
        if self._given is None and not self._periods:
            raise RecordingError(f"{self.name}: got only blocks of one sample, expected a period; give `sample_period`")
        return round_period(float(np.median(self._periods))) if self._given is None else self._given

    @property
    def numbers(self) -> NDArray[np.int64]:
        """Running number of every sample; the index wraps at 2³²."""
        index = self._index.array().astype(np.int64)
        steps = (np.diff(index) + 2**31) % 2**32 - 2**31
        return np.concatenate(([0], steps.cumsum()))

    @property
    def channels(self) -> dict[str, Samples]:
        """Samples of every channel in order of arrival."""
        return {name: column.array() for name, column in self._channels.items()}

    def begin(self, period: float) -> float:
        """Time of number 0 by the stamps of all blocks [ns].

        Raises
        ------
        RecordingError
            If the stamps contradict the index: a restart, or a clock that was set.
        """
        begins = np.array(self._times_ns, np.int64) - np.int64(self._times_ns[0])
        begins = begins - self.numbers[self.places] * period * 1e9
        spread = float(np.ptp(begins)) * 1e-9
        if spread > max(LARGEST_SKEW, period):
            raise RecordingError(
                f"{self.name}: the stamps move by {spread:.3g} s against the index, expected a driver that ran without "
                "a restart and a clock that was not set; record the axes again, in shorter bags if the clocks drift"
            )
        return self._times_ns[0] + float(np.median(begins))

    def was_driven(self, numbers: NDArray[np.int64], first: int) -> bool:
        """Whether the stage had been driven, or was moving, before the sample with number `first` among `numbers`."""
        before = self._channels["voltage"].array()[numbers <= first]
        return bool(self._phase.array()[np.argmin(numbers)] != 0 or np.ptp(before) > 0)
