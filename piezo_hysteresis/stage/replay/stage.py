"""`ReplayStage`: a recorded experiment in place of a device."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np

from ...errors import StageError
from ...record import Record
from ..stage import Acquired, Description, Samples


class ReplayStage:
    """Plays records of one sample period, one after the other, as a streaming stage.

    The drive asked for is not played: `Description.ignores_drive` tells so, and what comes back is the recorded voltage
    with the recorded displacement. After the last record the last sample is held, or everything begins again.

    Parameters
    ----------
    records : iterable of Record
        An `Experiment` or any sequence; all of one sample period.
    name : str
        Name of the stage.
    repeat : bool
        Begin again after the last sample.

    Raises
    ------
    StageError
        Without a record, or with records of different sample periods.

    Examples
    --------
    >>> stage = ReplayStage([Record([0.0, 1.0], [0.0, 1e-6], 1e-3)])
    >>> stage.exchange(np.zeros(2)).voltage.tolist(), stage.finished
    ([0.0, 1.0], True)
    """

    def __init__(self, records: Iterable[Record], *, name: str = "replay", repeat: bool = False) -> None:
        self._records = tuple(records)
        if not self._records:
            raise StageError(f"{name}: got no record, expected at least one")
        periods = sorted({r.sample_period for r in self._records})
        if periods[-1] > periods[0] * (1 + 1e-9):
            raise StageError(
                f"{name}: got records of {periods[0]:g} to {periods[-1]:g} s per sample, expected one sample period; "
                "replay the phases of each period by themselves"
            )
        self._applied = np.concatenate([r.voltage for r in self._records])
        self._measured = np.concatenate([r.displacement for r in self._records])
        shared = [name for name in self._records[0].channels if all(name in r.channels for r in self._records)]
        self._channels = {name: np.concatenate([r.channels[name] for r in self._records]) for name in shared}
        self._repeat, self._position, self._closed = repeat, 0, False
        low, high = float(self._applied.min()), float(self._applied.max())
        self._description = Description(
            name=name,
            streaming=True,
            sample_period_min=periods[0],
            sample_period_max=periods[0],
            voltage_min=low,
            voltage_max=high,
            safe_voltage=min(max(0.0, low), high),
            measured_voltage=True,
            ignores_drive=True,
        )

    def __iter__(self) -> Iterator[Record]:
        return iter(self._records)

    @property
    def description(self) -> Description:
        """Period and range of the recording; `ignores_drive` is True."""
        return self._description

    @property
    def sample_period(self) -> float:
        """Sample period of the recording [s]."""
        return self._description.sample_period_min

    @property
    def voltage(self) -> float:
        """Recorded voltage of the sample played last [V]; before the first one, of that."""
        return float(self._applied[max(self._position - 1, 0)])

    @property
    def finished(self) -> bool:
        """True when every sample has been played and nothing repeats."""
        return self._position >= self._applied.size

    @property
    def record(self) -> Record:
        """The record that the next sample comes from; after the end the last one."""
        ends = np.cumsum([r.size for r in self._records])
        return self._records[min(int(np.searchsorted(ends, self._position, side="right")), len(ends) - 1)]

    def configure(self, sample_period: float) -> None:
        """Accept the recording's own sample period [s]; StageError for any other."""
        self._require_open()
        self._description.check_sample_period(sample_period)

    def exchange(self, voltage: Samples) -> Acquired:
        """The next recorded samples, as many as the block has; its values are ignored."""
        self._require_open()
        count = int(np.size(voltage))
        if count == 0:
            raise StageError(f"{self._description.name}: got an empty block, expected at least one sample")
        total = self._applied.size
        index = np.arange(self._position, self._position + count)
        index = index % total if self._repeat else np.minimum(index, total - 1)
        end = self._position + count
        self._position = (end - 1) % total + 1 if self._repeat else min(end, total)

        others = {name: values[index] for name, values in self._channels.items()}
        return Acquired(self._applied[index], self._measured[index], others)

    def restrict(self, limits: Description, ramp_rate: float) -> None:
        """Ignored: nothing is put out."""
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
        return float(self._measured[max(self._position - 1, 0)])

    def safe(self) -> None:
        """Nothing is energised."""

    def close(self) -> None:
        """End the replay; every later call that takes samples raises StageError."""
        self._closed = True

    def _require_open(self) -> None:
        if self._closed:
            raise StageError(f"{self._description.name}: is closed, expected an open stage; make a new one")
