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

"""The stage protocol: what every back end, simulated or real, offers to the driver.

Two kinds of device exist. A *streaming* device takes a block of drive voltages and returns what it applied and
measured, block after block without a gap. A device with *on-board memory* is given a whole waveform, armed, started,
waited for and read out. Both have a slow path, one voltage and one displacement at a time. All voltages are drive
voltages before the amplifier; a back end that measures behind it divides by `Description.amplifier_gain`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Protocol

from ..channel_mapping import ChannelMapping
from .description import Description, Samples

__all__ = ["Acquired", "Description", "MemoryStage", "Samples", "Stage", "StreamingStage"]


@dataclass(frozen=True, eq=False, slots=True)
class Acquired:
    """What a stage applied and measured, sample by sample.

    Parameters
    ----------
    voltage : (n,) ndarray
        Applied drive voltage [V].
    displacement : (n,) ndarray
        Measured displacement [m].
    channels : mapping of str to (n,) ndarray, optional
        Other measured channels, as in `Record.channels`.
    """

    voltage: Samples
    displacement: Samples
    channels: Mapping[str, Samples] = field(default_factory=ChannelMapping)


class Stage(Protocol):
    """Common part of both kinds of device: description, clock, slow path, and the ramp to the safe voltage."""

    @property
    def description(self) -> Description:
        """Limits and kind of the device. They do not change while it is open."""
        ...

    @property
    def sample_period(self) -> float:
        """Present sample period [s]."""
        ...

    @property
    def voltage(self) -> float:
        """Present drive voltage [V]."""
        ...

    def configure(self, sample_period: float) -> None:
        """Set the sample period [s]; StageError if the device cannot run at it or is playing."""
        ...

    def restrict(self, limits: Description, ramp_rate: float) -> None:
        """From now on, keep every voltage inside the range and slew of `limits`, and ramp at this rate [V/s].

        StageError if they allow more than the stage does.
        """
        ...

    def set_voltage(self, voltage: float) -> None:
        """Slow path: go to one voltage [V] at the ramp rate and hold it; StageError outside the limits."""
        ...

    def read_voltage(self) -> float:
        """Slow path: the drive voltage measured now [V]; the present commanded voltage if it is not measured."""
        ...

    def read_displacement(self) -> float:
        """Slow path: one reading of the sensor [m]."""
        ...

    def safe(self) -> None:
        """Stop a waveform that is playing, and ramp to the safe voltage. It may be repeated."""
        ...

    def close(self) -> None:
        """Go to the safe voltage and release the device. It may be repeated; every other call raises StageError."""
        ...

    def leave(self) -> None:
        """Release the device without moving it, because another program drives it."""
        ...


class StreamingStage(Stage, Protocol):
    """A device whose clock keeps running while blocks are exchanged."""

    def exchange(self, voltage: Samples) -> Acquired:
        """Apply a block of drive voltages, and return the same number of applied and measured samples.

        Sample i of the answer belongs to sample i of the drive, or to the sample `Description.latency` before it.
        Voltage and displacement of the answer always belong together. The next block follows without a gap.

        Raises
        ------
        StageError
            If the drive violates a limit (then nothing is played), or the device fails.
        """
        ...


class MemoryStage(Stage, Protocol):
    """A device that plays and records from its own memory: upload, arm, start, wait, read."""

    def watch(self, is_interrupted: Callable[[], bool]) -> None:
        """Call `is_interrupted` before every message of upload, arm, start and read; StoppedError once it is true.

        Nothing is started after that. The ramp to the safe voltage cannot be interrupted.
        """
        ...

    def upload(self, voltage: Samples) -> None:
        """Store a waveform [V] that starts from the present voltage; StageError if it violates a limit."""
        ...

    def arm(self) -> None:
        """Prepare generator and recorder; StageError if there is no waveform."""
        ...

    def start(self) -> None:
        """Start generator and recorder together and return; StageError unless armed."""
        ...

    def wait(self, timeout: float) -> None:
        """Return when the waveform has been played; StageError after `timeout` seconds. The waveform continues then."""
        ...

    def read(self) -> Acquired:
        """The record of the last waveform; StageError before it is complete. The last voltage is held."""
        ...
