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

"""`find_change`: which parameter of a given model has changed since it was identified, and by how much.

Gain and loop height differ a little from day to day. They are fitted together with every change, with a quadratic
penalty, and are named themselves if they changed by more. A change is named if it explains the residual that these
small changes leave. Other changes that explain as much are its rivals.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..effects import Softening
from ..errors import ParameterError
from ..identification.records.noise_floor import ADEQUATE
from ..model.model import Model
from ..record import Record
from .account import DAY_TO_DAY, FARTHEST, Account
from .change_kinds import KINDS, LEAVES, ParameterChange
from .change_search import ChangeSearch
from .explanation import Explanation, half_interval, low_pass_before, moved_resonance
from .lag.motion_between_samples import unseen_lag
from .lag.other_filter import other_filters
from .signatures import SECOND_ORDER, SHAPES, shaped_model

Array = NDArray[np.float64]

UNCHANGED = ADEQUATE**0.5
"""Largest ratio of the error to the known one for which nothing has changed visibly."""
EXPLAINS = 0.7
"""Largest share of V that a change may leave, relative to V with fitted gain, loop height and zero."""
NEARLY_ALL, NEARLY_ALL_OF_A_SHAPE = 0.08, 0.01
"""Largest share of V that a change may leave if V remains above `LEAVES`, because no form describes a large change
exactly. Gain, loop height and softening change the shape of the loop, and together they resemble another loop."""
SHAPES_OF_LOOPS = ("gain", "loop", Softening.name)
"""Changes of the shape of the loop."""
SEEN = 0.7
"""Smallest size of a reported change, RMS in floors."""
RIVAL = 1.15
"""Ratio of V up to which another change always counts as explaining as much; beside a remaining V above it, that V is
the ratio, because what remains is then an error of the form."""
FORMS = 6.0
"""Largest ratio of V for which another change counts as explaining as much, and the lag of another form counts in the
interval."""
FORM_SHOWN = 2.0
"""Smallest lag of which samples show the form [samples]."""
SURE = 2.5
"""Smallest significant change, in standard errors."""


def find_change(
    model: Model,
    records: Sequence[Record],
    used: Sequence[int],
    floors: Sequence[float],
    progress: Callable[[float], None] = lambda part: None,
) -> ParameterChange | None:
    """The change of one parameter that explains the residual of a given model.

    Parameters
    ----------
    model : Model
        Model identified before the change.
    records : sequence of Record
        Records after the change, in order.
    used : sequence of int
        Indices of the records to explain.
    floors : sequence of float
        Floor of every record [m], including the known error of the model.
    progress : callable
        Called with the fraction done.

    Returns
    -------
    ParameterChange or None
        None if nothing changed, if no known change explains the residual, or if the change is not significant.
    """
    search = ChangeSearch(model, records, used, floors)
    day = search.account("none")
    if search.of_equal_records(day, floors) + day.cost - day.left <= ADEQUATE:
        return None
    found = _explanations(search, model, progress)
    others = _other_filters(search, found[0])
    shown = [e for e in others[:1] if e.size > FORM_SHOWN * model.sample_period]
    if shown and RIVAL * shown[0].account.cost < found[0].account.cost:
        found.insert(0, others.pop(0))
    best, search = found[0].account, found[0].search
    share = NEARLY_ALL_OF_A_SHAPE if best.key in SHAPES_OF_LOOPS else NEARLY_ALL
    leaves = best.left < max(LEAVES, share * day.cost)
    if not (leaves and best.cost < EXPLAINS * day.cost and day.cost - best.cost > SEEN**2):
        return None
    jackknife, *beside = search.halves(best).tolist()
    unseen = unseen_lag(model) if KINDS[best.key].lag else 0.0
    spread = _spread_of_forms(found[0], found[1:], others[:1])
    half = float(np.linalg.norm((jackknife, found[0].alike(day.cost), spread, unseen / (KINDS[best.key].lag or 1.0))))
    size = found[0].size
    if not is_sure(size, half) or (best.key in DAY_TO_DAY and abs(size) < FARTHEST * DAY_TO_DAY[best.key]):
        return None
    same = float(np.clip(best.left, RIVAL, FORMS))
    near = [e.account.key for e in found[1:] if e.account.cost < same * max(1.0, best.cost)]
    also = _moved_too(search, best, dict(zip(search.sides, beside, strict=True)))
    rivals = tuple(k for k in dict.fromkeys(near) if k != best.key and k not in also)
    low, middle, high = (search.stated(best.key, number) for number in (size - half, size, size + half))
    return ParameterChange(
        best.key, middle, (low, high), rivals, day.cost, best.left, search.session(best), also, unseen, found[0].added
    )


def _explanations(search: ChangeSearch, model: Model, progress: Callable[[float], None]) -> list[Explanation]:
    """What each change with a name explains, the best first."""
    keys = [k for k, kind in KINDS.items() if k in SHAPES or (kind.rows and kind.rows[0] in search.predicted[0].rows)]
    first = [k for k in (*search.sides, *keys) if k != "low_pass_before"]
    found = []
    for done, key in enumerate(first, 1):
        found.append(Explanation(search, search.best(key)))
        progress(done / (len(first) + 1))
    if "resonance" in keys and min(e.account.cost for e in found) > LEAVES:
        found.append(moved_resonance(search, model))
    least = min(e.account.cost for e in found)
    lagging = next(e for e in found if e.account.key == "low_pass")
    if _may_be(lagging, least) and lagging.size > 0.0:
        found.append(low_pass_before(search, model, lagging.size))
    simulated = [_simulated(e, model) if _may_be(e, least) else e for e in found]
    found = [e for e in simulated if e is not None]
    # at similar cost, a delay or a filter of first order comes before one of second order
    found.sort(key=lambda e: e.account.cost * (RIVAL if e.account.key in SECOND_ORDER else 1.0))
    most = RIVAL * max(1.0, found[0].account.cost)
    sides = [e for e in found if e.account.key in DAY_TO_DAY and e.account.cost < most]
    if found[0] in sides:  # of gain and loop height, the one that is farther from what differs from day to day
        found.sort(key=lambda e: e is not max(sides, key=lambda s: _in_deviations(s.search, s.account, s.account.key)))
    return found


def _may_be(found: Explanation, least: float) -> bool:
    """Whether a lag may be the change, so that it is worth an exact simulation."""
    return found.account.key in SHAPES and found.account.cost < FORMS * max(1.0, least)


def _in_deviations(search: ChangeSearch, account: Account, name: str) -> float:
    """Change of gain or loop height in standard deviations of its change from day to day.

    The mean slope and the model's gain differ by the share of the loop; the smaller change counts.
    """
    return min(abs(account.own[name]), abs(search.session(account)[name])) / DAY_TO_DAY[name]


def _moved_too(
    search: ChangeSearch, best: Account, halves: Mapping[str, float]
) -> dict[str, tuple[float, float, float]]:
    """Gain and loop height that have changed beside `best` by more than from day to day, with 95 % intervals."""
    found = {}
    for name, jackknife in halves.items():
        size = best.own[name]
        half = half_interval(best, name, jackknife)
        if name != best.key and _in_deviations(search, best, name) > FARTHEST and is_sure(size, half):
            low, high = search.stated(name, size - half), search.stated(name, size + half)
            found[name] = search.stated(name, size), low, high
    return found


def error_ratio(model: Model, records: Sequence[Record], used: Sequence[int], floors: Sequence[float]) -> float:
    """RMS error of an unchanged model over the known one, without the differences of a day; arguments as `find_change`.

    It is in the measure of the error that a model states. With the weights of the search, an unchanged stage may seem
    to have changed, and a small change may be hidden.
    """
    search = ChangeSearch(model, records, used, floors)
    return float(np.sqrt(search.of_equal_records(search.account("none"), floors)))


def _simulated(found: Explanation, model: Model) -> Explanation | None:
    """A delay or a filter, with the residual that remains when the model simulates it; None if no effect is so slow.

    An interpolated prediction leaves a larger residual if a stage rings within a few samples. Its size is more certain,
    because the delay of the model was fitted with the same interpolation.
    """
    key, size = found.account.key, found.account.size
    if key not in SHAPES or size < 0.0:
        return found
    try:
        slower = shaped_model(model, key, size)
    except ParameterError:
        return None
    search = found.search.around(slower)
    exact = search.shaped(key, near=0.0) if key == "delay" else search.account(key)
    least = min(found.account, exact, key=lambda account: account.cost)
    return replace(found, account=replace(found.account, cost=least.cost, left=least.left))


def _other_filters(search: ChangeSearch, best: Explanation) -> list[Explanation]:
    """Filters of other forms, best first, if a lag leaves an error that they may explain."""
    lag = KINDS[best.account.key].lag * best.size
    return other_filters(search, lag) if lag > 0.0 and best.account.cost > RIVAL else []


def _spread_of_forms(best: Explanation, alike: Sequence[Explanation], nearest: Sequence[Explanation]) -> float:
    """Largest difference to the lag of another form, in the unit of the best explanation.

    Samples hardly show which form a lag of about a sample has. The `nearest` other filter counts whatever error it
    leaves: what one pole more or less changes is what the records do not show.
    """
    unit = KINDS[best.account.key].lag
    if not unit:
        return 0.0
    most = FORMS * max(1.0, best.account.cost)
    forms = [*nearest, *(e for e in alike if e.account.cost < most)]
    lags = [e.size * KINDS[e.account.key].lag for e in forms if KINDS[e.account.key].lag]
    return max((abs(lag / unit - best.size) for lag in lags), default=0.0)


def is_sure(size: float, half: float) -> bool:
    """Whether a size differs from 0; `half` is half its 95 % interval."""
    return bool(np.isfinite(half) and abs(size) > SURE * half / 1.96)
