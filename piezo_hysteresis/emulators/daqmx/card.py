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

"""`Card`: an emulated multifunction card, its buffers on one clock, wired to a simulated stage."""

from __future__ import annotations

import math
import time
from collections.abc import Iterable, Sequence
from contextlib import suppress

import numpy as np

from ...stage.description import Samples
from ...stage.simulated import SimulatedStage
from ..fault import Fault, Faults

UNDERFLOW, OUT_OF_RANGE, NOT_RUNNING = -200290, -200077, -200278
"""Error numbers of NI-DAQmx."""

INPUTS = ("ai0", "ai1", "ai2", "_ao0_vs_aognd")
"""Inputs, the last one inside the card: the output, read back."""

_TIMEBASE = 100e6
"""Clock that sample clocks are divided from [Hz]."""
_LOOP_BACK_DELAY = 2
"""Samples by which a wired loop back answers later."""


class CardError(Exception):
    """Ends a call with an error number of NI-DAQmx."""

    def __init__(self, number: int, words: str) -> None:
        super().__init__(words)
        self.number = number


class Card:
    """Output ``ao0`` drives the stage; ``ai0`` is its sensor, ``ai1`` the amplifier's monitor, ``ai2`` the output.

    The output can be read back inside the card, too, unless it is a card that cannot.

    Parameters
    ----------
    stage : SimulatedStage
        What is wired to the card.
    sensor_gain : float
        Displacement over sensor voltage [m/V].
    monitor_gain : float
        Monitor voltage over piezo voltage [V/V].
    speed : float
        Seconds of the card per second; infinite to play what is in the output buffer as soon as it is asked for.
    reads_back : bool
        False for a card that cannot read its output back.
    faults : iterable of Fault
    """

    def __init__(
        self,
        stage: SimulatedStage,
        *,
        sensor_gain: float = 6e-6,
        monitor_gain: float = 0.1,
        speed: float = 1.0,
        reads_back: bool = True,
        faults: Iterable[Fault] = (),
    ) -> None:
        self._stage, self._speed, self.faults = stage, speed, Faults(faults)
        self.inputs = INPUTS if reads_back else INPUTS[:-1]
        self._sensor_gain, self._monitor_gain = sensor_gain, monitor_gain
        self._begin, self._played, self._is_finite = 0.0, 0, False
        self._buffer: Samples = np.empty(0)
        self._acquired: Samples = np.empty((len(INPUTS), 0))
        self._echo: Samples = np.zeros(_LOOP_BACK_DELAY)
        self._position = 0.0
        self.is_running = False

    @property
    def voltage(self) -> float:
        """Voltage at the output [V]."""
        return self._stage.voltage

    @property
    def available(self) -> int:
        """Number of samples of every input that can be read."""
        self._advance()
        return int(self._acquired.shape[1])

    @property
    def left(self) -> float:
        """Time until the output buffer has been played [s]."""
        self._advance()
        return self._buffer.size * self._stage.sample_period / self._speed if self.is_running else 0.0

    def coerced(self, rate: float) -> float:
        """The rate that the clock sets for a requested rate [Hz]."""
        possible = _TIMEBASE / max(round(_TIMEBASE / rate), 1)
        return possible / 2 if self.faults.lasts("wrong_clock") else possible

    def start(self, rate: float, is_finite: bool) -> None:
        """Run the clock at `rate` [Hz]; a finite run ends with the buffer, any other one must never find it empty."""
        self._stage.configure(1 / rate)
        self._acquired, self._played = np.empty((len(INPUTS), 0)), 0
        self._begin, self.is_running, self._is_finite = time.monotonic(), True, is_finite

    def stop(self) -> None:
        """Stop the clock, also of a run that has ended by itself; the output holds what it has."""
        with suppress(CardError):
            self._advance()
        self.is_running, self._buffer = False, np.empty(0)

    def write(self, voltage: Samples) -> None:
        """Append to the output buffer [V]."""
        d = self._stage.description
        if not ((voltage >= d.voltage_min) & (voltage <= d.voltage_max)).all():
            raise CardError(OUT_OF_RANGE, "Requested value is not a supported value for this property.")
        self._advance()
        self._buffer = np.concatenate((self._buffer, voltage))

    def set(self, voltage: float) -> None:
        """Put one voltage out without a clock [V]."""
        self.write(np.full(1, voltage))
        self._run(self._buffer[-1:])
        self._buffer = np.empty(0)

    def look(self, channels: Sequence[str]) -> Samples:
        """One reading of each channel [V], without a clock; shape (channels, 1)."""
        with suppress(CardError):  # the writer gets the error of an empty buffer
            self._advance()
        return self._chosen(self._run(np.full(1, self.voltage)), channels)

    def remaining(self, count: int) -> float:
        """Time until `count` samples can be read [s]; infinite where they never can."""
        if not self.is_running and not self._is_finite:
            raise CardError(NOT_RUNNING, "The specified task is not running.")
        missing = count - self.available
        if missing > self._buffer.size and self._is_finite:
            return math.inf
        return max(missing, 0) * self._stage.sample_period / self._speed if missing > 0 else 0.0

    def read(self, channels: Sequence[str], count: int) -> Samples:
        """The next samples of each channel [V], shape (channels, count)."""
        taken, self._acquired = self._acquired[:, :count], self._acquired[:, count:]
        return self._chosen(taken, channels)

    def underflow(self) -> None:
        """End the run as a card does whose output buffer has run empty; CardError."""
        self.is_running = False
        raise CardError(UNDERFLOW, "The generation has stopped to prevent the regeneration of old samples.")

    def _chosen(self, inputs: Samples, channels: Sequence[str]) -> Samples:
        return inputs[[INPUTS.index(channel) for channel in channels]]

    def _advance(self) -> None:
        """Play the samples that are due."""
        if not self.is_running:
            return
        if math.isinf(self._speed):
            due = self._buffer.size
        else:
            elapsed = (time.monotonic() - self._begin) * self._speed
            due = int(elapsed / self._stage.sample_period) - self._played
        late = due > self._buffer.size
        block, self._buffer = self._buffer[:due], self._buffer[due:]
        if block.size:
            self._acquired = np.concatenate((self._acquired, self._run(block)), axis=1)
            self._played += block.size
        if late and not self._is_finite:
            self.underflow()

    def _run(self, voltage: Samples) -> Samples:
        """Inputs while so many voltages are put out [V], shape (4, n)."""
        lasts, d = self.faults.lasts, self._stage.description
        drive = np.ascontiguousarray(voltage)
        if lasts("saturated"):
            drive = np.minimum(drive, d.safe_voltage + 0.5 * (d.voltage_max - d.safe_voltage))
        got = self._stage.exchange(drive)
        displacement = np.full(drive.size, self._position) if lasts("stale") else got.displacement
        if lasts("skewed"):
            displacement = np.concatenate(([self._position], displacement[:-1]))
        self._position = float(displacement[-1] if lasts("stale") else got.displacement[-1])
        echo = np.concatenate((self._echo, got.voltage))
        self._echo = echo[-_LOOP_BACK_DELAY:]
        sensor = displacement / self._sensor_gain
        monitor = got.voltage * d.amplifier_gain * self._monitor_gain
        both = (monitor, sensor) if lasts("swapped") else (sensor, monitor)
        return np.stack((*both, echo[: drive.size], got.voltage))
