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

"""`ReplayStage`: a recorded experiment in place of a device."""

from __future__ import annotations

from collections.abc import Callable, Iterable

import numpy as np
from numpy.typing import NDArray

from ...errors import StageError
from ...record import Record
from ..stage import Acquired, Description, Samples
from .resampled import ResampledRecord


class ReplayStage:
    """Plays records one after the other, as a streaming stage of one sample period.

    The requested drive is not played: `Description.ignores_drive` is true, and every answer contains the recorded
    voltage and displacement. After the last record the last sample is held, or the first record follows.

    Parameters
    ----------
    records : iterable of Record
        An `Experiment` or any sequence.
    name : str
        Name of the stage.
    repeat : bool
        Begin again after the last sample.
    sample_period : float
        Time between played samples [s]; 0 for the shortest one of the records. Records of another period are resampled:
        see `ResampledRecord`, and `notices`.

    Raises
    ------
    StageError
        If there is no record, or one cannot be resampled.

    Examples
    --------
    >>> stage = ReplayStage([Record([0.0, 1.0], [0.0, 1e-6], 1e-3)])
    >>> stage.exchange(np.zeros(2)).voltage.tolist(), stage.finished
    ([0.0, 1.0], True)
    """

    def __init__(
        self, records: Iterable[Record], *, name: str = "replay", repeat: bool = False, sample_period: float = 0.0
    ) -> None:
        recorded = tuple(records)
        if not recorded:
            raise StageError(f"{name}: got no record, expected at least one")
        period = sample_period or min(r.sample_period for r in recorded)
        self._played = tuple(ResampledRecord(r, period) for r in recorded)
        self._ends = np.cumsum([played.size for played in self._played])
        self._channels = [key for key in recorded[0].channels if all(key in r.channels for r in recorded)]
        self._repeat, self._position, self._closed = repeat, 0, False
        low = min(float(played.record.voltage.min()) for played in self._played)
        high = max(float(played.record.voltage.max()) for played in self._played)
        self._description = Description(
            name=name,
            streaming=True,
            sample_period_min=period,
            sample_period_max=period,
            voltage_min=low,
            voltage_max=high,
            safe_voltage=min(max(0.0, low), high),
            measured_voltage=True,
            ignores_drive=True,
        )

    @property
    def phases(self) -> tuple[tuple[str, int], ...]:
        """Name and number of played samples of every record, in order."""
        return tuple((played.record.phase, played.size) for played in self._played)

    @property
    def notices(self) -> tuple[str, ...]:
        """Sentences about records that are played at another sample period."""
        names = [played.record.phase for played in self._played if played.is_resampled]
        if not names:
            return ()
        return (
            f"{self._description.name}: {len(names)} of {len(self._played)} phases are resampled to "
            f"{self.sample_period:g} s per sample: {', '.join(names)}",
        )

    @property
    def description(self) -> Description:
        """Period and range of the recording; `ignores_drive` is True."""
        return self._description

    @property
    def sample_period(self) -> float:
        """Time between played samples [s]."""
        return self._description.sample_period_min

    @property
    def voltage(self) -> float:
        """Recorded voltage of the sample played last [V]; before the replay begins, that of the first sample."""
        return float(self._values(self._last, _voltage_of)[0][0])

    @property
    def finished(self) -> bool:
        """True when every sample has been played and the recording is not repeated."""
        return bool(self._position >= self._ends[-1])

    @property
    def record(self) -> Record:
        """The record that the next sample comes from; after the end the last one."""
        return self._played[self._places(np.array([min(self._position, self._ends[-1] - 1)]))[0]].record

    def configure(self, sample_period: float) -> None:
        """Accept the sample period at which the recording is played [s]; StageError for any other."""
        self._require_open()
        self._description.check_sample_period(sample_period)

    def exchange(self, voltage: Samples) -> Acquired:
        """The next recorded samples, as many as the block has; its values are ignored."""
        self._require_open()
        count = int(np.size(voltage))
        if count == 0:
            raise StageError(f"{self._description.name}: got an empty block, expected at least one sample")
        total = int(self._ends[-1])
        index = np.arange(self._position, self._position + count)
        index = index % total if self._repeat else np.minimum(index, total - 1)
        end = self._position + count
        self._position = (end - 1) % total + 1 if self._repeat else min(end, total)
        voltage, displacement, *others = self._values(
            index, _voltage_of, _displacement_of, *(_channel(key) for key in self._channels)
        )
        return Acquired(voltage, displacement, dict(zip(self._channels, others, strict=True)))

    def restrict(self, limits: Description, ramp_rate: float) -> None:
        """Ignored: a recording has no output."""
        self._require_open()

    def set_voltage(self, voltage: float) -> None:
        """Ignored: a recording cannot be driven."""
        self._require_open()

    def read_voltage(self) -> float:
        """Recorded voltage of the sample played last [V]."""
        self._require_open()
        return self.voltage

    def read_displacement(self) -> float:
        """Recorded displacement of the sample played last [m]."""
        self._require_open()
        return float(self._values(self._last, _displacement_of)[0][0])

    def safe(self) -> None:
        """Do nothing: a recording has no voltage to remove."""

    def close(self) -> None:
        """End the replay; every later call that takes samples raises StageError."""
        self._closed = True

    def leave(self) -> None:
        """As `close`: a replay moves nothing."""
        self.close()

    @property
    def _last(self) -> NDArray[np.int64]:
        return np.array([max(self._position - 1, 0)])

    def _places(self, index: NDArray[np.int64]) -> NDArray[np.intp]:
        """Number of the record of every played sample."""
        return np.searchsorted(self._ends, index, side="right")

    def _values(self, index: NDArray[np.int64], *channels: Callable[[Record], Samples]) -> list[Samples]:
        """Channels at played samples, one array each."""
        places = self._places(index)
        values = [np.empty(index.size) for _ in channels]
        for place in np.unique(places):
            played, here = self._played[place], places == place
            local = index[here] - (self._ends[place] - played.size)
            for one, channel in zip(values, channels, strict=True):
                one[here] = played.at(channel(played.record), local)
        return values

    def _require_open(self) -> None:
        if self._closed:
            raise StageError(f"{self._description.name}: is closed, expected an open stage; make a new one")


def _voltage_of(record: Record) -> Samples:
    return record.voltage


def _displacement_of(record: Record) -> Samples:
    return record.displacement


def _channel(name: str) -> Callable[[Record], Samples]:
    return lambda record: record.channels[name]
