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

"""`Card`: an emulated multifunction card that is wired to a simulated stage; output and inputs have the same clock."""

from __future__ import annotations

import math
import time
from collections.abc import Iterable, Sequence

import numpy as np

from ...stage.description import Samples
from ...stage.simulated import SimulatedStage
from ..fault import Fault, Faults

UNDERFLOW, OUT_OF_RANGE, NOT_RUNNING = -200290, -200077, -200278
"""Error numbers of NI-DAQmx."""

INPUTS = ("ai0", "ai1", "ai2", "_ao0_vs_aognd")
"""Analogue inputs. The last one is an internal channel, which measures the output."""

_TIMEBASE = 100e6
"""Frequency of the clock from which the sample clock is divided [Hz]."""
_LOOP_BACK_DELAY = 2
"""Delay of a wired loop back from output to input [samples]."""


class CardError(Exception):
    """Ends a call with an error of NI-DAQmx.

    Parameters
    ----------
    number : int
        Error number.
    text : str
        Text of the error.
    """

    def __init__(self, number: int, text: str) -> None:
        super().__init__(text)
        self.number = number


class Card:
    """Output ``ao0`` drives the stage; ``ai0`` is its sensor, ``ai1`` the amplifier's monitor, ``ai2`` the output.

    The internal channel ``_ao0_vs_aognd`` measures the output, if `reads_back` is set.

    Parameters
    ----------
    stage : SimulatedStage
        The stage that is wired to the card.
    sensor_gain : float
        Displacement divided by sensor voltage [m/V].
    monitor_gain : float
        Monitor voltage divided by piezo voltage [V/V].
    speed : float
        Simulated seconds per second of the computer; infinite to play the whole output buffer at the next call.
    reads_back : bool
        Whether the card can measure its own output.
    faults : iterable of Fault
        Faults that occur.
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
        self.is_running, self._is_dry = False, False

    @property
    def voltage(self) -> float:
        """Voltage at the output [V]."""
        return self._stage.read_voltage()

    @property
    def available(self) -> int:
        """Number of samples of every input that can be read now."""
        self._advance()
        return int(self._acquired.shape[1])

    @property
    def left(self) -> float:
        """Time until the output buffer has been played [s]."""
        self._advance()
        return self._buffer.size * self._stage.sample_period / self._speed if self.is_running else 0.0

    def coerced(self, rate: float) -> float:
        """The nearest possible rate of the sample clock for a requested rate [Hz]."""
        possible = _TIMEBASE / max(round(_TIMEBASE / rate), 1)
        return possible / 2 if self.faults.lasts("wrong_clock") else possible

    def start(self, rate: float, is_finite: bool) -> None:
        """Start the clock at `rate` [Hz]. A finite run ends with the buffer; any other fails if it becomes empty."""
        self._stage.configure(1 / rate)
        self._acquired, self._played = np.empty((len(INPUTS), 0)), 0
        self._begin, self.is_running, self._is_finite, self._is_dry = time.monotonic(), True, is_finite, False

    def stop(self) -> None:
        """Stop the clock, also after a run that has ended; the output keeps its voltage."""
        self._advance()
        self.is_running, self._is_dry, self._buffer = False, False, np.empty(0)

    def write(self, voltage: Samples) -> None:
        """Append voltages (n,) to the output buffer [V]; CardError if one is out of range."""
        d = self._stage.description
        if not ((voltage >= d.voltage_min) & (voltage <= d.voltage_max)).all():
            raise CardError(OUT_OF_RANGE, "Requested value is not a supported value for this property.")
        self._advance()
        self._buffer = np.concatenate((self._buffer, voltage))

    def set(self, voltage: float) -> None:
        """Set the output to one voltage without a clock [V]; CardError if it is out of range."""
        self.write(np.full(1, voltage))
        self._run(self._buffer[-1:])
        self._buffer = np.empty(0)

    def look(self, channels: Sequence[str]) -> Samples:
        """One reading of each channel [V], without a clock; shape (channels, 1)."""
        self._advance()
        return self._chosen(self._run(np.full(1, self.voltage)), channels)

    def remaining(self, count: int) -> float:
        """Time until `count` samples can be read [s]; infinite if a run has fewer that ends. CardError if none runs."""
        missing = count - self.available
        if not (self.is_running or self._is_finite or self._is_dry):
            raise CardError(NOT_RUNNING, "The specified task is not running.")
        if missing > self._buffer.size and (self._is_finite or self._is_dry):
            return math.inf
        return max(missing, 0) * self._stage.sample_period / self._speed if missing > 0 else 0.0

    def read(self, channels: Sequence[str], count: int) -> Samples:
        """The next samples of each channel [V], shape (channels, count)."""
        taken, self._acquired = self._acquired[:, :count], self._acquired[:, count:]
        return self._chosen(taken, channels)

    def run_dry(self) -> None:
        """Play the output buffer to its end, as if the computer had been away for that long."""
        if self.is_running:
            self._play(self._buffer.size)
            self._end()

    def require_output(self) -> None:
        """CardError after the output buffer has become empty in a run without an end."""
        self._advance()
        if self._is_dry:
            raise CardError(UNDERFLOW, "The generation has stopped to prevent the regeneration of old samples.")

    def _chosen(self, inputs: Samples, channels: Sequence[str]) -> Samples:
        return inputs[[INPUTS.index(channel) for channel in channels]]

    def _advance(self) -> None:
        """Play the samples that are due by now."""
        if not self.is_running:
            return
        if math.isinf(self._speed):
            due = self._buffer.size
        else:
            elapsed = (time.monotonic() - self._begin) * self._speed
            due = int(elapsed / self._stage.sample_period) - self._played
        late = due > self._buffer.size
        self._play(due)
        if late:
            self._end()

    def _play(self, due: int) -> None:
        block, self._buffer = self._buffer[:due], self._buffer[due:]
        if block.size:
            self._acquired = np.concatenate((self._acquired, self._run(block)), axis=1)
            self._played += block.size

    def _end(self) -> None:
        """End a run without an end, whose clock stops with an empty buffer; a finite run is ended by its task."""
        if not self._is_finite:
            self.is_running, self._is_dry = False, True

    def _run(self, voltage: Samples) -> Samples:
        """Output voltages (n,) [V], and return the inputs meanwhile [V], shape (4, n)."""
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
