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

"""`SampleWindow`: the newest samples of a stream, measured and predicted, stored by their running numbers."""

from __future__ import annotations

import threading
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

CAPACITY = 1 << 19
"""Number of samples that are kept: 10 s at 50 kHz, in 21 MB."""

_MOST_EARLY = 100
"""Blocks of predictions that wait for their samples."""

_TURN = 1 << 32
"""The running number of a sample is counted modulo this."""


@dataclass(frozen=True, eq=False, slots=True)
class Window:
    """Consecutive samples; NaN where nothing was measured or predicted.

    Parameters
    ----------
    time : (n,) ndarray
        Time of every sample since the epoch, or since the start of a recording [s].
    voltage : (n,) ndarray
        Drive voltage [V].
    displacement : (n,) ndarray
        Measured displacement [m].
    prediction : (n,) ndarray
        Free-run prediction [m].
    sample_period : float
        Time between samples [s].
    """

    time: Array
    voltage: Array
    displacement: Array
    prediction: Array
    sample_period: float

    @property
    def size(self) -> int:
        """Number of samples."""
        return int(self.time.size)

    @property
    def residual(self) -> Array:
        """Measured minus predicted displacement [m]."""
        return self.displacement - self.prediction

    def part(self, first: int, end: int | None = None) -> Window:
        """Samples from `first` up to, but not including, `end`."""
        cut = slice(first, end)
        return Window(
            self.time[cut], self.voltage[cut], self.displacement[cut], self.prediction[cut], self.sample_period
        )


class SampleWindow:
    """Ring buffer of samples, written by one thread and read by another.

    Parameters
    ----------
    capacity : int
        Largest number of samples, a power of two.

    Attributes
    ----------
    received : int
        Number of received samples.
    """

    def __init__(self, capacity: int = CAPACITY) -> None:
        self._capacity = capacity
        self._lock = threading.Lock()
        self._rows = np.full((4, capacity), np.nan)
        self._period = 0.0
        self._end = 0
        self._filled = 0
        self._early: list[tuple[NDArray[np.uint32], Array]] = []
        self.received = 0

    def add(self, index: NDArray[np.uint32], time: Array, voltage: Array, displacement: Array) -> None:
        """Add a block of consecutive samples.

        A block that does not continue the stream within the capacity empties the window, because the driver was
        restarted or silent for long.

        Parameters
        ----------
        index : (n,) ndarray of uint32
            Running numbers modulo 2^32.
        time : (n,) ndarray
            Time of every sample since the epoch [s].
        voltage : (n,) ndarray
            Drive voltage [V].
        displacement : (n,) ndarray
            Measured displacement [m].
        """
        size = min(index.size, self._capacity)
        period = float(time[-1] - time[0]) / (time.size - 1) if time.size > 1 else self._period
        with self._lock:
            step = (int(index[0]) - self._end) % _TURN
            changed = bool(self._period) and abs(period / self._period - 1.0) > 0.01
            if changed or not self._filled or step >= self._capacity:
                self._filled, step = 0, 0
                self._end = int(index[0])
            if step:
                self._write(self._end, np.full((4, step), np.nan))
            self._period = period
            values = np.array([time, voltage, displacement, np.full(index.size, np.nan)])
            self._end = (int(index[-1]) + 1) % _TURN
            self._write(self._end - size, values[:, -size:])
            self._filled = min(self._filled + step + size, self._capacity)
            self.received += int(index.size)
            early, self._early = self._early, []
            for block in early:
                self._place(*block)

    def add_prediction(self, index: NDArray[np.uint32], prediction: Array) -> None:
        """Add predictions; those of samples that have left the window are ignored.

        The order of two topics is not defined, so that predictions may wait for their samples.

        Parameters
        ----------
        index : (n,) ndarray of uint32
            Running numbers modulo 2^32, one after the other.
        prediction : (n,) ndarray
            Free-run prediction [m].
        """
        with self._lock:
            self._place(index, prediction)

    def _place(self, index: NDArray[np.uint32], prediction: Array) -> None:
        if (int(index[-1]) + 1 - self._end) % _TURN in range(1, self._capacity):
            self._early = [*self._early[1 - _MOST_EARLY :], (index, prediction)]
        elif (self._end - int(index[0])) % _TURN <= self._filled:
            places = (int(index[0]) + np.arange(index.size)) % self._capacity
            self._rows[3, places] = prediction

    def _write(self, start: int, values: Array) -> None:
        start %= self._capacity
        ahead = min(values.shape[1], self._capacity - start)
        self._rows[:, start : start + ahead] = values[:, :ahead]
        self._rows[:, : values.shape[1] - ahead] = values[:, ahead:]

    @property
    def sample_period(self) -> float:
        """Time between samples [s]; 0 before the first block."""
        return self._period

    def newest(self, duration: float) -> Window:
        """The samples of the last `duration` [s], or all kept samples if there are fewer; the oldest first."""
        with self._lock:
            count = min(self._filled, round(duration / self._period) if self._period else 0)
            start = (self._end - count) % self._capacity
            rows = np.concatenate(
                (self._rows[:, start : start + count], self._rows[:, : max(0, start + count - self._capacity)]), axis=1
            )
        return Window(rows[0], rows[1], rows[2], rows[3], self._period)
