"""`Stretch`: samples of one phase from a stream."""

from __future__ import annotations

from dataclasses import dataclass

from ..record import Samples


@dataclass(frozen=True, eq=False, slots=True)
class Stretch:
    """Samples of one phase number and one sample period."""

    channels: dict[str, Samples]
    """Voltage [V], displacement [m] and what else the blocks hold."""
    sample_period: float
    phase: int
    start_time: float
    """Time of the first sample since the first one of the stream [s]."""
    received_ns: int
    """Time at which its first block was received [ns]."""
    lost: int
    """Samples missing just before it."""
    breaks: dict[int, int]
    """Sample before which others are missing, to their number."""
    pauses: dict[int, int]
    """Sample before which others were never measured while the voltage was held, to their number."""
    first: bool
    """True for the first stretch since a start of the driver, or of the recording."""

    @property
    def size(self) -> int:
        """Number of samples."""
        return self.channels["voltage"].size
