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

"""`find_turns`: the turning points of a drive, in one pass.

The function is plain Python, because a recording is read without the compiler; `identification` compiles it. What the
two ends of the drive mean is the choice of the caller.
"""

from __future__ import annotations

from collections.abc import MutableSequence, Sequence

import numpy as np
from numpy.typing import NDArray

from .record import Samples


def find_turns(
    u: Samples | Sequence[float],
    least: float,
    from_first: bool,
    turns: NDArray[np.int64] | MutableSequence[int],
) -> int:
    """Write the indices at which u (n,) turns back by more than `least` to turns (n,); returns their number.

    The first sample and the last one are not among them.

    Parameters
    ----------
    u : (n,) ndarray or sequence of float
        Drive [V].
    least : float
        A movement back by this or less is no turn [V].
    from_first : bool
        The first swing begins at the first sample, and a movement that stays within `least` of it is no swing.
        Otherwise the first swing may begin at any extreme, so that a swing that was under way is found earlier.
    turns : (n,) ndarray or sequence of int
        Indices of the turning points, in order.

    Examples
    --------
    >>> turns = [0] * 7
    >>> drive = [0.0, 2.0, -1.5, 1.5, -3.0, 3.0, -3.0]
    >>> turns[: find_turns(drive, 2.0, False, turns)], turns[: find_turns(drive, 2.0, True, turns)]
    ([2, 3, 4, 5], [4, 5])
    """
    count = 0
    low, high, at_low, at_high, direction = u[0], u[0], 0, 0, 0
    for i in range(len(u)):
        value = u[i]
        if value > high and (direction != 0 or not from_first):
            high, at_high = value, i
        if value < low and (direction != 0 or not from_first):
            low, at_low = value, i
        if direction >= 0 and high - value > least:
            if direction > 0:
                turns[count] = at_high
                count += 1
            direction, low, at_low, high, at_high = -1, value, i, value, i
        elif direction <= 0 and value - low > least:
            if direction < 0:
                turns[count] = at_low
                count += 1
            direction, low, at_low, high, at_high = 1, value, i, value, i
    return count
