"""`Card`: an emulated multifunction card, its buffers on one clock, wired to a simulated stage."""

from __future__ import annotations

import math
import time
from collections.abc import Collection

import numpy as np

from ....errors import StageError
from ...description import Samples
from ...simulated import SimulatedStage

UNDERFLOW, TIMEOUT, OUT_OF_RANGE, NOT_RUNNING, RESOURCE_LOST = -200290, -200284, -200077, -200278, -200324
"""Error numbers of NI-DAQmx."""

FAULTS = {
    "link_lost": "the server stops answering in the midst of a stream",
    "device_lost": "the card is unplugged in the midst of a stream",
    "underflow": "the output buffer runs empty",
    "slow": "samples come later than the time-out",
    "short_read": "fewer samples come than were asked for",
}
"""What can be made to go wrong, once, at the third read of a stream."""

_STRIKES_AT = 3
_LOOP_BACK_DELAY = 2


class CardError(Exception):
    """Ends a call with an error number of NI-DAQmx."""

    def __init__(self, number: int, words: str) -> None:
        super().__init__(words)
        self.number = number


class Card:
    """Output ``ao0`` drives the stage; ``ai0`` is its sensor, ``ai1`` the amplifier's monitor, ``ai2`` the output.

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
    faults : collection of str
        Keys of `FAULTS`.
    """

    def __init__(
        self,
        stage: SimulatedStage,
        *,
        sensor_gain: float = 6e-6,
        monitor_gain: float = 0.1,
        speed: float = 1.0,
        faults: Collection[str] = (),
    ) -> None:
        unknown = sorted(set(faults) - set(FAULTS))
        if unknown:
            raise StageError(f"fault: got '{unknown[0]}', expected one of {', '.join(FAULTS)}")
        self._stage, self._speed, self._faults = stage, speed, set(faults)
        self._sensor_gain, self._monitor_gain = sensor_gain, monitor_gain
        self._begin, self._played, self._reads = 0.0, 0, 0
        self._buffer: Samples = np.empty(0)
        self._acquired: dict[str, Samples] = {}
        self._echo: Samples = np.zeros(_LOOP_BACK_DELAY)
        self.is_running = False

    @property
    def voltage(self) -> float:
        """Voltage at the output [V]."""
        return self._stage.voltage

    def start(self, rate: float) -> None:
        """Run the clock at `rate` [Hz]."""
        self._stage.configure(1 / rate)
        self._acquired, self._played, self._reads = {}, 0, 0
        self._begin, self.is_running = time.monotonic(), True

    def stop(self) -> None:
        """Stop the clock; the output holds what it has."""
        if self.is_running:
            self._advance()
        self.is_running, self._buffer = False, np.empty(0)

    def write(self, voltage: Samples) -> None:
        """Append to the output buffer [V]."""
        d = self._stage.description
        if voltage.min() < d.voltage_min or voltage.max() > d.voltage_max:
            raise CardError(OUT_OF_RANGE, "Requested value is not a supported value for this property.")
        if self.is_running:
            self._advance()
        self._buffer = np.concatenate((self._buffer, voltage))

    def set(self, voltage: float) -> None:
        """Put one voltage out without a clock [V]."""
        self.write(np.full(1, voltage))
        self._run(self._buffer[-1:])
        self._buffer = np.empty(0)

    def look(self, channels: list[str]) -> Samples:
        """One reading of each channel [V], without a clock."""
        return np.array([values[-1] for values in self._run(np.full(1, self.voltage), channels).values()])

    def read(self, channels: list[str], count: int, timeout: float) -> Samples:
        """The next samples of each channel [V], shape (channels, count); waits for them."""
        self._reads += 1
        if self._reads == _STRIKES_AT:
            count = self._strike(count)
        if not self.is_running:
            raise CardError(NOT_RUNNING, "The specified task is not running.")
        due = time.monotonic() + timeout
        self._advance()
        while self._available < count:
            lacking = (count - self._available) * self._stage.sample_period / self._speed
            if time.monotonic() + lacking > due:
                raise CardError(TIMEOUT, "Some or all of the samples requested have not yet been acquired.")
            time.sleep(lacking)
            self._advance()
        taken = np.stack([self._acquired[channel][:count] for channel in channels])
        self._acquired = {channel: values[count:] for channel, values in self._acquired.items()}
        return taken

    @property
    def _available(self) -> int:
        return min((values.size for values in self._acquired.values()), default=0)

    def _strike(self, count: int) -> int:
        if "device_lost" in self._faults:
            raise CardError(RESOURCE_LOST, "Device not available for routing. It is possible that it was removed.")
        if "slow" in self._faults:
            self._faults.discard("slow")
            raise CardError(TIMEOUT, "Some or all of the samples requested have not yet been acquired.")
        if "link_lost" in self._faults:
            raise ConnectionError
        if "underflow" in self._faults:
            self._underflow()
        return count - 1 if "short_read" in self._faults else count

    def _underflow(self) -> None:
        self._faults.discard("underflow")
        self.is_running = False
        raise CardError(UNDERFLOW, "The generation has stopped to prevent the regeneration of old samples.")

    def _advance(self) -> None:
        """Play what is due."""
        if math.isinf(self._speed):
            due = self._buffer.size
        else:
            elapsed = (time.monotonic() - self._begin) * self._speed
            due = int(elapsed / self._stage.sample_period) - self._played
        late = due > self._buffer.size
        block, self._buffer = self._buffer[:due], self._buffer[due:]
        if block.size:
            for channel, values in self._run(block, ["ai0", "ai1", "ai2"]).items():
                self._acquired[channel] = np.concatenate((self._acquired.get(channel, np.empty(0)), values))
            self._played += block.size
        if late:
            self._underflow()

    def _run(self, voltage: Samples, channels: list[str] | None = None) -> dict[str, Samples]:
        gain = self._stage.description.amplifier_gain
        got = self._stage.exchange(np.ascontiguousarray(voltage))
        echo = np.concatenate((self._echo, got.voltage))
        self._echo = echo[-_LOOP_BACK_DELAY:]
        wired = {
            "ai0": got.displacement / self._sensor_gain,
            "ai1": got.voltage * gain * self._monitor_gain,
            "ai2": echo[: voltage.size],
        }
        return {channel: wired[channel] for channel in channels or ()}
