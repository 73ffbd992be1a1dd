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

"""`SampleBlock`: samples of a stage and their phases. `Delivery`: a block and its events. `Tally`: counters."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..stage.stage import Acquired, Samples
from .drive import Event
from .time_base import LATEST_STAMP

_COLUMNS = ("time", "voltage", "displacement", "index", "phase")
"""Arrays that every block has."""


@dataclass(frozen=True, eq=False, slots=True)
class SampleBlock:
    """Consecutive samples of a stage: the content of one message of the topic `samples`.

    Parameters
    ----------
    stamp : int
        Time of the first sample on the driver's clock [ns].
    time : (n,) ndarray of float64
        Time of every sample since the stamp [s].
    voltage : (n,) ndarray of float64
        Drive voltage before the amplifier [V].
    displacement : (n,) ndarray of float64
        Measured displacement [m].
    index : (n,) ndarray of uint32
        Running number of the sample, modulo 2^32.
    phase : (n,) ndarray of uint32
        Number of the phase.
    frame : str
        Frame in which the displacement is measured; in recordings of earlier versions the name of the stage.
    follows_gap : bool
        True if the samples missing before the block were never measured (a device reads out its memory). If it is
        False, missing samples mean lost messages.
    channels : mapping of str to (n,) ndarray
        Further measured channels, as in `Record.channels`.
    """

    stamp: int
    time: Samples
    voltage: Samples
    displacement: Samples
    index: NDArray[np.uint32]
    phase: NDArray[np.uint32]
    frame: str = ""
    follows_gap: bool = False
    channels: Mapping[str, Samples] = field(default_factory=dict)

    @classmethod
    def acquired(
        cls,
        acquired: Acquired,
        phase: NDArray[np.uint32],
        stamp: int,
        sample_period: float,
        first: int,
        *,
        follows_gap: bool = False,
    ) -> SampleBlock:
        """The block of what a stage has returned: `first` is the index of its first sample, taken at `stamp` [ns]."""
        count = acquired.voltage.size
        return cls(
            stamp=stamp,
            time=np.arange(count) * np.float64(sample_period),
            voltage=acquired.voltage,
            displacement=acquired.displacement,
            index=np.arange(first, first + count).astype(np.uint32),  # modulo 2^32
            phase=phase,
            follows_gap=follows_gap,
            channels=acquired.channels,
        )

    @property
    def size(self) -> int:
        """Number of samples."""
        return int(self.time.size)

    @property
    def columns(self) -> dict[str, NDArray]:
        """Arrays by field name of the topic `samples`."""
        return {**self.channels, **{name: getattr(self, name) for name in _COLUMNS}}

    def after(self, count: int) -> SampleBlock:
        """The block without its first `count` samples."""
        return self if count == 0 else self._part(slice(count, None), self.follows_gap)

    def between(self, first: int, end: int) -> SampleBlock:
        """Samples from `first` up to, but not including, `end`. Only the first part of a block can follow a gap."""
        return self._part(slice(first, end), self.follows_gap and first == 0)

    def _part(self, part: slice, follows_gap: bool) -> SampleBlock:
        kept: dict[str, Any] = {name: getattr(self, name)[part] for name in _COLUMNS}
        others = {name: values[part] for name, values in self.channels.items()}
        return replace(self, **kept, channels=others, follows_gap=follows_gap)

    @property
    def sample_period(self) -> float | None:
        """Time between samples [s]; None for a block of one sample."""
        return float(self.time[-1] - self.time[0]) / (self.size - 1) if self.size > 1 else None


@dataclass(frozen=True, eq=False, slots=True)
class Delivery:
    """One block and the events in it.

    Parameters
    ----------
    block : SampleBlock
        The samples; none if the acquisition ends with these events.
    first : int
        Index of the first sample, not wrapped at 2^32.
    events : tuple of Event
        Events; their offsets count from the first sample of the block.
    """

    block: SampleBlock
    first: int
    events: tuple[Event, ...]

    @classmethod
    def without_samples(cls, first: int, events: tuple[Event, ...]) -> Delivery:
        """Events after the last sample, which has index `first` - 1."""
        none, no_number = np.empty(0), np.empty(0, np.uint32)
        return cls(SampleBlock(0, none, none, none, no_number, no_number), first, events)


@dataclass(slots=True)
class Tally:
    """Counters and times of an acquisition since its start.

    Parameters
    ----------
    samples, blocks, never_measured : int
        Numbers of delivered samples, of blocks, and of samples that were not measured.
    undated : int
        Number of blocks whose time is too late for a message, so that their stamp stands still.
    latest : float
        Largest delay of a block [s].
    postponed, clock_jumps, clock_drift : float
        Sums of the shifts of the time base [s]: after delays, after jumps of the node's clock, and to follow the clock
        of a device.
    """

    samples: int = 0
    blocks: int = 0
    never_measured: int = 0
    undated: int = 0
    latest: float = 0.0
    postponed: float = 0.0
    clock_jumps: float = 0.0
    clock_drift: float = 0.0

    def count(self, block: SampleBlock, never_measured: int) -> None:
        """Count a block, and the samples that were not measured before it."""
        self.samples, self.blocks = self.samples + block.size, self.blocks + 1
        self.undated += block.stamp == LATEST_STAMP
        self.never_measured += never_measured
