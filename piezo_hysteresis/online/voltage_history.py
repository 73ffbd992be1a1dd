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

"""`VoltageHistory`: keeps the past drive voltage, so that a new model can be run over it."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..model.free_run import held_drive

Array = NDArray[np.float64]

FULL_SAMPLES = 3_000_000
"""Largest number of samples kept at the full rate: a minute at 50 kHz. With the further half that may be kept before
samples are averaged, this is 36 MB."""

REST_TOLERANCE = 5e-4
"""Voltages within this distance count as held [voltage scales]; it allows for the noise of a measured drive."""

USUAL_SCALE = 10.0
"""Voltage scale [V] that is assumed while there is no model."""


@dataclass(frozen=True, eq=False, slots=True)
class DriveHistory:
    """A frozen copy of the past drive voltage.

    Parameters
    ----------
    rest_voltage : float
        Voltage [V] before the first value: that of the stage at rest, or that of the newest average removed.
    start_time : float
        Time of the first value since the beginning of the stream [s].
    slow_period, sample_period : float
        Times [s] that one value of `slow` and one value of `full` cover.
    slow : (m,) ndarray
        Averages over `slow_period` [V], the oldest first.
    full : (n,) ndarray
        All samples after the averages [V].
    holds : tuple of (int, float)
        Times at one voltage that have no values: the number of values before each, and its duration [s].
    """

    rest_voltage: float
    start_time: float
    slow_period: float
    sample_period: float
    slow: Array
    full: Array
    holds: tuple[tuple[int, float], ...] = ()

    def until(self, first: int) -> Iterator[tuple[float, Array]]:
        """The drive before value `first` of `full`: sample period [s] and voltages [V], part by part."""
        values, begin = np.concatenate((self.slow, self.full[:first])), 0
        kept = [hold for hold in self.holds if hold[0] <= values.size]
        for end, hold in sorted([*kept, (self.slow.size, 0.0), (values.size, 0.0)]):
            period = self.slow_period if begin < self.slow.size else self.sample_period
            yield period, values[begin:end]
            if hold:
                yield held_drive(values[end - 1] if end else self.rest_voltage, hold, period)
            begin = end


class VoltageHistory:
    """Keeps all samples of the last `duration`, and averages over `slow_period` of the time before.

    The history begins where the drive leaves `rest_voltage`. Samples before the first motion are not kept.

    Parameters
    ----------
    sample_period : float
        Time between samples [s].
    duration : float
        Time kept at the full rate [s], limited by `FULL_SAMPLES`; it grows by up to half before the oldest part is
        averaged.
    slow_period : float
        Averaging time of older samples [s].
    slow_duration : float
        Time kept as averages [s]; it grows by up to half before the oldest averages are removed.
    """

    def __init__(
        self,
        sample_period: float,
        duration: float = 60.0,
        slow_period: float = 0.01,
        slow_duration: float = 3600.0,
    ) -> None:
        self.sample_period = sample_period
        self.factor = max(1, round(slow_period / sample_period))
        """Number of samples in one average."""
        self.tolerance = REST_TOLERANCE * USUAL_SCALE
        """Voltages within this distance [V] count as held."""
        self.rest_voltage = 0.0
        """Voltage [V] held before the first sample kept."""
        self.count = 0
        """Number of samples of the stream so far."""
        self.travel = 0.0
        """Travel of the drive since the beginning of the stream [V], a lower bound. Each block adds its voltage range,
        including the last voltage that was counted. A range below twice `tolerance` is not counted, because it may be
        the noise of a measured drive."""
        self._unknown_at: float | None = None
        self._last_counted = 0.0
        self.has_rested = False
        """True once a block of the drive was held."""
        self._has_moved = False
        full = min(duration / sample_period, FULL_SAMPLES)
        self._limit = self.factor * max(1, round(full / self.factor))
        self._slow_limit = max(1, round(slow_duration / sample_period / self.factor))
        self._full = np.empty(self.factor)
        self._kept = 0
        self._slow = np.empty(0)
        self._holds: list[tuple[int, int]] = []

    @property
    def start(self) -> int:
        """Position in the stream of the first sample that is kept, averaged or in full."""
        return self._full_start - self.factor * self._slow.size

    @property
    def known_travel(self) -> float:
        """Travel of the drive since its voltage was last unknown [V]; infinite if the voltage was always known."""
        return math.inf if self._unknown_at is None else self.travel - self._unknown_at

    def mark_unknown(self) -> None:
        """Record that earlier voltages are unknown: those of lost samples, or those before the first sample."""
        self._unknown_at = self.travel

    @property
    def last(self) -> float:
        """Newest voltage [V]."""
        return float(self._full[self._kept - 1]) if self._kept else self.rest_voltage

    def append(self, voltage: Array) -> None:
        """Add the next samples [V], shape (n,)."""
        low, high = float(voltage.min()), float(voltage.max())
        held = high - low <= 2 * self.tolerance
        if self.count == 0:
            self.rest_voltage = float(voltage[0])
            self._last_counted = self.rest_voltage
        self.count += voltage.size
        self.has_rested |= held
        if not self._has_moved and held and max(high - self.rest_voltage, self.rest_voltage - low) <= self.tolerance:
            return
        self._has_moved = True
        self._add_travel(low, high, float(voltage[-1]))
        if self._kept + voltage.size > self._full.size:
            grown = np.empty(2 * (self._kept + voltage.size))
            grown[: self._kept] = self._full[: self._kept]
            self._full = grown
        self._full[self._kept : self._kept + voltage.size] = voltage
        self._kept += voltage.size
        if self._kept > 1.5 * self._limit:
            self._average()

    def hold(self, samples: int) -> None:
        """Note many further samples at the newest voltage, which are not kept and have no position."""
        self._holds.append((self.count, samples))

    def held_until(self, position: int) -> int:
        """Number of samples of every `hold` up to a position."""
        return sum(samples for at, samples in self._holds if at <= position)

    def next_hold(self, position: int) -> int:
        """Position of the next `hold`; the end of the stream if there is none."""
        return min((at for at, _ in self._holds if at > position), default=self.count)

    def read(self, position: int, values: int) -> tuple[int, Array]:
        """The voltages of the stream from sample `position` on.

        Parameters
        ----------
        position : int
            Where the last `read` ended, or `start`.
        values : int
            Number of values. At the full rate it is rounded up to a multiple of `factor`; at the end there are fewer.

        Returns
        -------
        factor : int
            Number of samples of the stream that one value covers: 1, or `factor` in the averaged part.
        voltage : (m,) ndarray
            Averaged or full values [V], never both; empty at the end of the stream.
        """
        if position < self._full_start:
            first = (position - self.start) // self.factor
            return self.factor, self._slow[first : first + values].copy()
        first = position - self._full_start
        whole = -(-values // self.factor) * self.factor
        return 1, self._full[first : min(first + whole, self._kept)].copy()

    def copy(self) -> DriveHistory:
        """A frozen copy of the history as it is now."""
        period = self.sample_period
        full = self._full[: self._kept].copy()
        start_time = (self.start + self.held_until(self.start)) * period
        holds = tuple((self._values_until(at), n * period) for at, n in self._holds if at > self.start)
        return DriveHistory(self.rest_voltage, start_time, self.factor * period, period, self._slow.copy(), full, holds)

    def _values_until(self, position: int) -> int:
        """Number of values that are kept, averaged or in full, up to a position in the stream."""
        in_full = position - self._full_start
        return self._slow.size + (in_full if in_full >= 0 else in_full // self.factor)

    @property
    def _full_start(self) -> int:
        return self.count - self._kept

    def _add_travel(self, low: float, high: float, last: float) -> None:
        span = max(high, self._last_counted) - min(low, self._last_counted)
        if span > 2 * self.tolerance:
            self.travel += span
            self._last_counted = last

    def _average(self) -> None:
        old = (self._kept - self._limit) // self.factor * self.factor
        means = self._full[:old].reshape(-1, self.factor).mean(axis=1)
        self._slow = np.concatenate((self._slow, means))
        if self._slow.size > 1.5 * self._slow_limit:
            self.rest_voltage = float(self._slow[-self._slow_limit - 1])
            self._slow = self._slow[-self._slow_limit :]
        self._full[: self._kept - old] = self._full[old : self._kept].copy()
        self._kept -= old


def is_held(voltage: Array, tolerance: float = REST_TOLERANCE * USUAL_SCALE) -> bool:
    """Whether a block of voltages [V], shape (n,), stays within `tolerance` [V] of one level."""
    return float(voltage.max()) - float(voltage.min()) <= 2 * tolerance
