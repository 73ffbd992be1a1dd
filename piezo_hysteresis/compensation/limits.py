"""`Limits`: what the drive may do while a path is followed."""

from __future__ import annotations

import math
from dataclasses import dataclass

from ..errors import StageError


@dataclass(frozen=True, slots=True)
class Limits:
    """Range and slope of the drive voltage.

    Parameters
    ----------
    voltage_min, voltage_max : float
        Range of the drive before the amplifier [V].
    max_slew_rate : float
        Steepest change between two samples [V/s].

    Raises
    ------
    StageError
        If the limits contradict one another.
    """

    voltage_min: float = -math.inf
    voltage_max: float = math.inf
    max_slew_rate: float = math.inf

    def __post_init__(self) -> None:
        if not self.voltage_min < self.voltage_max:
            raise StageError(
                f"voltage limits: got {self.voltage_min:g} to {self.voltage_max:g} V, "
                "expected a minimum below the maximum"
            )
        if not self.max_slew_rate > 0:
            raise StageError(f"max_slew_rate: got {self.max_slew_rate!r}, expected a positive number of V/s")
