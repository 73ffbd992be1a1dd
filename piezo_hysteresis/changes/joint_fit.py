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

"""`fit_jointly`: gain, loop height and lag of new records, each with an interval that contains what imitates it.

In one sine a later response resembles a higher loop, because both widen the same ellipse. So neither interval is that
of a stage whose other number is known. What the records leave open, the differences from day to day decide: gain and
loop height may differ a little, and the lag stays unless the records show for certain that it changed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .account import DAY_TO_DAY, FARTHEST, Account
from .change_search import AROUND, ChangeSearch
from .explanation import UNCERTAIN
from .parameter_changes import RIVAL, SEEN, is_sure

Array = NDArray[np.float64]

HALF_OF_NORMAL = 1.96
"""Half a 95 % interval, in standard deviations."""
LARGEST_LOOP = 0.5
"""Largest relative change of a loop height that may be taken for a lag; a loop does not vanish or double."""
BLURRED = 2.0
"""Ratio of the interval of a loop height to that with a known lag from which records hardly distinguish the two."""


@dataclass(frozen=True, eq=False, slots=True)
class JointFit:
    """Gain, loop height and lag.

    Parameters
    ----------
    account : Account
        The fit; its lag is 0 unless it is certain.
    intervals_95 : mapping of str to (float, float)
        95 % intervals by name, ``gain``, ``loop_height`` and ``lag`` [s]; infinite if the records have too few parts.
    is_blurred : bool
        Whether the records hardly distinguish a lag from a loop height.
    """

    account: Account
    intervals_95: dict[str, tuple[float, float]]
    is_blurred: bool


def fit_jointly(search: ChangeSearch) -> JointFit:
    """The fit of gain, loop height and lag.

    If the records leave more than the floors, whatever the three are, that remainder is the floor. If they do not show
    the loop height better than it is known from day to day, its penalty has no limit.
    """
    free = search.shaped("delay", free=search.sides)
    search = search.more_cautious(max(1.0, free.left) ** 0.5)
    has_loop, usual = "loop" in search.sides, DAY_TO_DAY["loop"]
    known = _Posterior(search, search.account("delay", free.size, search.sides))
    is_blurred = has_loop and known.halves[-1] > max(usual, BLURRED * known.half_at_known_lag)
    if has_loop and known.halves[-1] > usual:
        search = search.more_cautious(1.0, ["loop"])
    still, late = search.account("delay"), search.shaped("delay")
    jackknife = search.halves(late)
    is_usual = has_loop and abs(late.own["loop"]) <= FARTHEST * usual
    day, found = (_Posterior(search, late, factor * usual if is_usual else np.inf) for factor in (1.0, FARTHEST))
    parts = jackknife[0] if np.unique(search.labels).size > 1 else 0.0  # one part cannot be left out
    sure = still.cost - late.cost > SEEN**2 and is_sure(late.size, float(np.hypot(day.halves[0], parts)))
    best = late if sure else still
    if sure and has_loop:
        other = search.account("delay", free=search.sides)
        if abs(other.own["loop"]) < LARGEST_LOOP and other.left < RIVAL * max(1.0, late.left):
            best, is_blurred = other, True
    half, middle, point = np.hypot(found.halves, jackknife), found.middle, numbers_of(search, best)
    low, high = np.minimum(middle, point) - half, np.maximum(middle, point) + half
    intervals = {"lag": (float(low[0]), float(high[0]))}
    for k, name in enumerate(search.sides, 1):
        ends = float(max(low[k], -1.0)), float(high[k])
        is_finite = bool(np.isfinite(half[k]))
        stated = (search.stated(name, ends[0]), search.stated(name, ends[1])) if is_finite else (-np.inf, np.inf)
        intervals["loop_height" if name == "loop" else name] = stated
    return JointFit(best, intervals, bool(is_blurred))


def numbers_of(search: ChangeSearch, account: Account) -> Array:
    """Lag, gain and loop height of an account (1 + sides,)."""
    return np.array([account.size, *(account.own[n] for n in search.sides)])


class _Posterior:
    """Lag, gain and loop height together, near an account; the remaining error may resemble any direction of them.

    Parameters
    ----------
    search : ChangeSearch
        The records.
    account : Account
        The fit.
    usual : float
        Standard deviation of the loop height before the records; infinite if nothing is known.

    Attributes
    ----------
    middle, halves : (1 + sides,) ndarray
        Means and half 95 % intervals.
    half_at_known_lag : float
        Half the interval of the last of them, if the lag were known.
    """

    def __init__(self, search: ChangeSearch, account: Account, usual: float = np.inf) -> None:
        rows = search.directions(account, AROUND * min(p.record.sample_period for p in search.predicted))
        uncertain = UNCERTAIN * max(1.0, account.cost) ** 0.5
        at = numbers_of(search, account)
        prior = np.zeros(at.size)
        prior[-1] = (uncertain / HALF_OF_NORMAL / usual) ** 2
        size = np.maximum(np.linalg.norm(rows, axis=1), np.finfo(np.float64).tiny)
        unit = rows / size[:, None]
        gram = unit @ unit.T + np.diag(prior / size**2)
        inverse = np.linalg.pinv(gram, rcond=1e-12, hermitian=True)
        self.middle = at + inverse @ (unit @ search.residual(account) - prior * at / size) / size
        self.halves = uncertain * np.sqrt(np.diag(inverse)) / size
        beside = np.linalg.pinv(gram[1:, 1:], rcond=1e-12, hermitian=True)
        self.half_at_known_lag = float(uncertain * np.sqrt(beside[-1, -1]) / size[-1])
