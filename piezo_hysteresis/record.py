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

"""`Record`: drive voltage and measured displacement of one phase. `Experiment`: records in order."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from .channel_mapping import ChannelMapping, Samples, channel_samples
from .errors import RecordError, counted, printable
from .html_table import html_table
from .notice import Notice
from .picture import Pictured

__all__ = ["CONDITIONING", "Experiment", "Notice", "Record", "Samples"]

CONDITIONING = "conditioning"
"""Name of a phase that brings the stage into a known state; the history before it is unknown."""


@dataclass(frozen=True, eq=False, slots=True, weakref_slot=True)
class Record(Pictured):
    """One phase of an experiment at a constant sample period.

    Parameters
    ----------
    voltage : (n,) array_like
        Drive voltage before the amplifier [V].
    displacement : (n,) array_like
        Measured displacement [m].
    sample_period : float
        Time between samples [s], positive. In phases slower than the model the samples are block averages.
    phase : str
        Phase name, e.g. ``"triangle"``, made printable.
    start_time : float
        Time of the first sample since the start of the experiment [s].
    continues : bool
        True where the stage was not brought to rest since the record before.
    truncated : bool
        True where the beginning is missing, so that the initial state is unknown.
    initial_voltage : float, optional
        Voltage at which the stage had settled before the first sample [V]; default the first voltage.
    channels : mapping of str to (n,) array_like, optional
        What else was measured, e.g. ``other_displacement`` of the coupled axis [m], ``displacement_3``,
        ``monitor_voltage`` [V], ``temperature`` of the stage [K]; the names are those of `ChannelMapping`.
    voltage_noise : float
        Standard deviation of the noise in the voltage, as far as it was estimated [V]; files do not contain it.

    Raises
    ------
    RecordError
        On empty, non-finite or unequal channels, or a sample period that is not positive.

    Examples
    --------
    >>> r = Record([0.0, 1.0, 2.0], [0.0, 1e-6, 2e-6], 1e-3, phase="step")
    >>> r.size, r.duration, r[1:].start_time
    (3, 0.003, 0.001)
    """

    voltage: Samples
    displacement: Samples
    sample_period: float
    phase: str = "record"
    start_time: float = 0.0
    continues: bool = False
    truncated: bool = False
    initial_voltage: float | None = None
    channels: Mapping[str, Samples] = field(default_factory=ChannelMapping)
    voltage_noise: float = 0.0

    def __post_init__(self) -> None:
        put = object.__setattr__
        put(self, "voltage", channel_samples("voltage", self.voltage, None))
        size = self.voltage.size
        put(self, "displacement", channel_samples("displacement", self.displacement, size))
        put(self, "channels", ChannelMapping({n: channel_samples(n, c, size) for n, c in self.channels.items()}))
        put(self, "sample_period", float(self.sample_period))
        if not 0.0 < self.sample_period < np.inf:
            raise RecordError(f"sample_period: got {self.sample_period!r} s, expected a positive time")
        put(self, "phase", printable(self.phase) or "record")
        for name in ("start_time", "initial_voltage"):
            if (number := getattr(self, name)) is not None:
                put(self, name, float(number))  # a number of numpy would be written to a table as np.float64(…)
                if not np.isfinite(number):
                    raise RecordError(f"{name}: got {number!r}, expected a finite number")

    def __repr__(self) -> str:
        return f"Record({', '.join(self.summary())})"

    def summary(self) -> tuple[str, str, str, str]:
        """Phase, samples with their period, drive and displacement, in words."""
        u, y = self.voltage, 1e6 * self.displacement
        return (
            self.phase,
            f"{counted(self.size, 'sample')} of {self.sample_period:g} s",
            f"{u.min():.4g} to {u.max():.4g} V",
            f"{y.min():.4g} to {y.max():.4g} µm",
        )

    @property
    def size(self) -> int:
        """Number of samples."""
        return int(self.voltage.size)

    @property
    def duration(self) -> float:
        """Number of samples times sample period [s]."""
        return self.size * self.sample_period

    @property
    def time(self) -> Samples:
        """Time of every sample since the start of the experiment [s], shape (n,)."""
        return np.asarray(self.start_time + self.sample_period * np.arange(self.size))

    @property
    def settled_voltage(self) -> float:
        """Voltage at which the stage had settled before the first sample [V]."""
        return float(self.voltage[0]) if self.initial_voltage is None else float(self.initial_voltage)

    def is_named(self, *phases: str) -> bool:
        """Whether the phase name, or its first word, is one of `phases`; words are separated by underscores.

        >>> [Record([0.0], [0.0], 1.0, phase="sine_50hz").is_named(name) for name in ("sine", "sine_50hz", "sine_50")]
        [True, True, False]
        """
        return self.phase in phases or self.phase.split("_")[0] in phases

    def __getitem__(self, part: slice) -> Record:
        """A contiguous part; a later one continues what was before it, and has no `initial_voltage`."""
        start, stop, step = part.indices(self.size)
        if step != 1 or stop <= start:
            raise RecordError(f"slice {part}: expected a non-empty contiguous part of {self.size} samples")
        return self.with_channels(
            lambda c: c[start:stop],
            start_time=self.start_time + start * self.sample_period,
            continues=self.continues or start > 0,
            initial_voltage=None if start > 0 else self.initial_voltage,
        )

    def with_channels(self, change: Callable[[Samples], Samples], **fields: Any) -> Record:
        """Voltage, displacement and every other channel changed alike, and the other fields given replaced.

        Parameters
        ----------
        change : callable
            From the samples of a channel to what takes their place.
        **fields
            Of the record.

        Examples
        --------
        >>> Record([0.0, 1.0], [0.0, 2e-6], 1e-3).with_channels(np.flip, phase="backwards").voltage.tolist()
        [1.0, 0.0]
        """
        others = {name: change(values) for name, values in self.channels.items()}
        samples = {"voltage": change(self.voltage), "displacement": change(self.displacement)}
        return replace(self, **{"channels": others, **samples, **fields})

    def split(self, *boundaries: int) -> tuple[Record, ...]:
        """Cut at the given sample indices; every part but the first continues the one before it."""
        edges = [0, *boundaries, self.size]
        return tuple(self[a:b] for a, b in zip(edges, edges[1:], strict=False))

    def decimate(self, factor: int) -> Record:
        """Average blocks of `factor` samples: anti-aliased, as slow phases are stored.

        Parameters
        ----------
        factor : int
            Samples per block, 1 or more; an incomplete last block is dropped.

        Raises
        ------
        RecordError
            If the factor is not between 1 and the number of samples.
        """
        if not 1 <= factor <= self.size:
            raise RecordError(f"decimate: got factor {factor}, expected 1 to {self.size}")
        blocks = self.size // factor

        def mean(channel: Samples) -> Samples:
            return np.asarray(channel[: blocks * factor].reshape(blocks, factor).mean(axis=1))

        return self.with_channels(mean, sample_period=self.sample_period * factor, initial_voltage=self.settled_voltage)


@dataclass(frozen=True, eq=False, slots=True)
class Experiment(Pictured):
    """Records in the order in which they were taken, and what was noticed on reading them.

    Raises
    ------
    RecordError
        If there is no record.
    """

    records: tuple[Record, ...]
    source: str = ""
    notices: tuple[Notice, ...] = field(default=())

    def __post_init__(self) -> None:
        object.__setattr__(self, "records", tuple(self.records))
        if not self.records:
            raise RecordError(f"experiment '{self.source}' holds no record; expected at least one phase")

    def __repr__(self) -> str:
        return "\n".join((self._title(), *(f"  {record!r}" for record in self)))

    def _repr_html_(self) -> str:
        titles = ("phase", "samples", "drive voltage", "displacement")
        return html_table(self._title(), titles, map(Record.summary, self))

    def _title(self) -> str:
        return f"Experiment of {counted(len(self), 'phase')}, {self.size} samples, {len(self.notices)} findings"

    def __iter__(self) -> Iterator[Record]:
        return iter(self.records)

    def __len__(self) -> int:
        return len(self.records)

    def __getitem__(self, index: int) -> Record:
        return self.records[index]

    @property
    def size(self) -> int:
        """Number of samples in all records."""
        return sum(r.size for r in self.records)

    @property
    def fastest_period(self) -> float:
        """Smallest sample period [s]."""
        return min(r.sample_period for r in self.records)

    @property
    def range(self) -> float:
        """Peak to peak of the displacement over all records [m]: the 100 % of every percentage."""
        lowest = min(float(r.displacement.min()) for r in self.records)
        return max(float(r.displacement.max()) for r in self.records) - lowest

    def noting(self, *notices: Notice) -> Experiment:
        """The same records, with more notices."""
        return replace(self, notices=(*self.notices, *notices))

    def named(self, *phases: str) -> tuple[Record, ...]:
        """Records whose phase name, or its first word, is one of `phases`; as `Record.is_named`."""
        return tuple(r for r in self.records if r.is_named(*phases))
