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
        Drive voltage really applied [V].
    displacement : (n,) ndarray
        Measured displacement [m].
    channels : mapping of str to (n,) ndarray, optional
        What else was measured, as in `Record.channels`.
    """

    voltage: Samples
    displacement: Samples
    channels: Mapping[str, Samples] = field(default_factory=ChannelMapping)


class Stage(Protocol):
    """What both kinds of device share: description, clock, slow path and the way to safety."""

    @property
    def description(self) -> Description:
        """Limits and kind of the device; does not change while it is open."""
        ...

    @property
    def sample_period(self) -> float:
        """Sample period in force [s]."""
        ...

    @property
    def voltage(self) -> float:
        """Drive voltage in force [V]."""
        ...

    def configure(self, sample_period: float) -> None:
        """Set the sample period [s]; StageError if the device cannot run at it or is playing."""
        ...

    def restrict(self, limits: Description, ramp_rate: float) -> None:
        """Hold the range and slew of `limits` and a ramp rate [V/s] from now on, on every path to the device.

        StageError if they allow more than the stage does.
        """
        ...

    def set_voltage(self, voltage: float) -> None:
        """Slow path: go to one voltage [V] at the ramp rate and hold it; StageError outside the limits."""
        ...

    def read_voltage(self) -> float:
        """Slow path: the drive voltage measured now [V]; the one in force where nothing measures it."""
        ...

    def read_displacement(self) -> float:
        """Slow path: one reading of the sensor [m]."""
        ...

    def safe(self) -> None:
        """Stop what plays and go to the safe voltage at the ramp rate; harmless when repeated."""
        ...

    def close(self) -> None:
        """Make safe and release the device; harmless when repeated, every other call then raises StageError."""
        ...


class StreamingStage(Stage, Protocol):
    """A device whose clock keeps running while blocks are exchanged."""

    def exchange(self, voltage: Samples) -> Acquired:
        """Apply a block of drive voltages and return the samples applied and measured, as many as were given.

        Sample i of the answer belongs to sample i of the drive, or to the one `Description.latency` before it; voltage
        and displacement of the answer belong together always. The next block follows without a gap.

        Raises
        ------
        StageError
            If the drive breaks a limit (nothing is played), or the device fails.
        """
        ...


class MemoryStage(Stage, Protocol):
    """A device that plays and records from its own memory: upload, arm, start, wait, read."""

    def watch(self, is_interrupted: Callable[[], bool]) -> None:
        """Look at `is_interrupted` before every message of upload, arm, start and read; StoppedError once it is true.

        Nothing is started after that, and the way to safety does not look.
        """
        ...

    def upload(self, voltage: Samples) -> None:
        """Store a waveform [V]; it counts from the voltage in force; StageError if it breaks a limit."""
        ...

    def arm(self) -> None:
        """Make generator and recorder ready; StageError without a waveform."""
        ...

    def start(self) -> None:
        """Start generator and recorder together and return; StageError unless armed."""
        ...

    def wait(self, timeout: float) -> None:
        """Return when the waveform has been played; StageError after `timeout` seconds, the waveform plays on."""
        ...

    def read(self) -> Acquired:
        """The record of the last waveform; StageError before it is complete. The last voltage is held."""
        ...
