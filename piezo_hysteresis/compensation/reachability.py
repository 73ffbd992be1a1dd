"""`Reachability`: the answer of `reachable`, with every `UnreachablePart` and the `NearestPath`."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class UnreachablePart:
    """A part of a path that the limits of the drive do not allow.

    Parameters
    ----------
    begin, end : float
        Time from the start of the path [s].
    largest : float
        Largest deviation of what the drive gives instead, signed [m].
    needed_min, needed_max : float
        Voltage that the path would need [V].
    needed_slew : float
        Steepest change that it would need [V/s].
    limit : str
        ``voltage_min``, ``voltage_max`` or ``max_slew_rate``.
    after_loop : bool
        True where the same displacement can be had from rest, but no longer after the swing before it.
    """

    begin: float
    end: float
    largest: float
    needed_min: float
    needed_max: float
    needed_slew: float
    limit: str
    after_loop: bool = False

    def __str__(self) -> str:
        needed = {
            "voltage_min": f"{self.needed_min:.3g} V",
            "voltage_max": f"{self.needed_max:.3g} V",
            "max_slew_rate": f"{self.needed_slew:.3g} V/s",
        }[self.limit]
        message = (
            f"{self.begin:.6g} to {self.end:.6g} s cannot be had: it needs {needed}, beyond {self.limit}; "
            f"the stage would be off by up to {1e9 * abs(self.largest):.0f} nm"
        )
        if self.after_loop:
            message += (
                "; from rest this displacement is within the limits, but after a swing the hysteresis holds the stage "
                "above it and only a voltage below the minimum brings it back"
            )
        return message


@dataclass(frozen=True, slots=True)
class NearestPath:
    """Changes of a path, each of which alone makes it reachable; None where that change does not.

    Parameters
    ----------
    offset : float or None
        To be added to the whole path [m].
    amplitude : float or None
        Factor about the middle of the path, below 1.
    band : float or None
        Frequency above which the path may hold nothing [Hz].
    """

    offset: float | None
    amplitude: float | None
    band: float | None


@dataclass(frozen=True, eq=False, slots=True)
class Reachability:
    """Answer of `reachable`.

    Parameters
    ----------
    parts : tuple of UnreachablePart
        Empty where the whole path can be had.
    nearest : NearestPath or None
        None where the whole path can be had.
    displacement : (n,) ndarray
        What the limited drive gives [m].
    voltage : (n + preview,) ndarray
        The limited drive [V].
    """

    parts: tuple[UnreachablePart, ...]
    nearest: NearestPath | None
    displacement: Array
    voltage: Array

    @property
    def is_whole(self) -> bool:
        """Whether all of the path can be had."""
        return not self.parts
