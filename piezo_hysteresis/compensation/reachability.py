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

"""`Reachability`: the answer of `reachable`, with every `UnreachablePart` and the `NearestPath`."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..parameter import slew_text

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class UnreachablePart:
    """A part of a path that the limits of the drive do not allow.

    Parameters
    ----------
    begin, end : float
        Time from the start of the path [s].
    largest : float
        Displacement with the limits minus displacement without them, where its magnitude is largest [m].
    needed_min, needed_max : float
        Lowest and highest voltage that this part would need [V].
    needed_slew : float
        Largest rate of change of the voltage that it would need [V/s].
    limit : str
        The limit that is exceeded most: ``voltage_min``, ``voltage_max`` or ``max_slew_rate``; ``amplifier`` if the
        drive is inside its limits, but not inside those of the amplifier of the model; ``model`` if no voltage gives
        the displacement.
    other_limits : tuple of str
        Other limits of the drive that are exceeded.
    after_loop : bool
        True if the displacement can be reached from rest, but not after the preceding motion, because of the
        hysteresis.
    """

    begin: float
    end: float
    largest: float
    needed_min: float
    needed_max: float
    needed_slew: float
    limit: str
    other_limits: tuple[str, ...] = ()
    after_loop: bool = False

    def __str__(self) -> str:
        slew = slew_text(self.needed_slew, 4)
        statements = {
            "voltage_min": f"{self.needed_min:.3g} V, below voltage_min",
            "voltage_max": f"{self.needed_max:.3g} V, above voltage_max",
            "max_slew_rate": f"{slew}, above max_slew_rate",
            "amplifier": f"{self.needed_min:.3g} to {self.needed_max:.3g} V with up to {slew}, more than the amplifier "
            "of the model gives",
            "model": "a displacement that no voltage gives in the model",
        }
        needed = ", and ".join(statements[limit] for limit in (self.limit, *self.other_limits))
        message = (
            f"the path cannot be reached from {self.begin:.4g} to {self.end:.4g} s: it needs {needed}; the error would "
            f"be up to {1e9 * abs(self.largest):.0f} nm"
        )
        if self.after_loop:
            message += (
                "; the displacement can be reached from rest, but not after this motion, because the hysteresis keeps "
                "the stage beyond it"
            )
        return message


@dataclass(frozen=True, slots=True)
class NearestPath:
    """Changes of a path, each of which alone makes it reachable; None for a change that does not.

    Parameters
    ----------
    offset : float or None
        Offset of the whole path [m].
    amplitude : float or None
        Factor below 1 by which the path is scaled about its middle.
    band : float or None
        Frequency above which the path may have no components [Hz].
    """

    offset: float | None
    amplitude: float | None
    band: float | None

    def conditions(self) -> str:
        """Changes after which the path can be reached, joined by "or"; empty if there is none."""
        ways = []
        if self.offset is not None:
            ways.append(f"if it is shifted by {1e6 * self.offset:+.4g} µm")
        if self.amplitude is not None:
            ways.append(f"if its amplitude about the middle is reduced to {100.0 * self.amplitude:.4g} %")
        if self.band is not None:
            ways.append(f"if its components above {self.band:.3g} Hz are removed")
        return " or ".join(ways)


@dataclass(frozen=True, eq=False, slots=True)
class Reachability:
    """Result of `reachable`.

    Parameters
    ----------
    parts : tuple of UnreachablePart
        Unreachable parts; empty if the whole path is reachable.
    displacement : (n,) ndarray
        Displacement under the limited drive [m].
    voltage : (n + preview,) ndarray
        The limited drive [V].
    nearest : NearestPath, optional
        Nearest reachable path, which `plan` searches for if not the whole path is reachable.
    """

    parts: tuple[UnreachablePart, ...]
    displacement: Array
    voltage: Array
    nearest: NearestPath | None = None

    @property
    def is_whole(self) -> bool:
        """Whether the whole path is reachable."""
        return not self.parts
