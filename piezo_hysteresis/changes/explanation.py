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

"""`Explanation`: an account of a change, and the search for changes that are linear only near the solution."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from ..effects import AmplifierBandwidth, ExtraResonance
from ..identification.steps.remaining_lag import amplifier_of
from ..model.model import Model
from .account import Account
from .change_search import ChangeSearch
from .signatures import shaped_model

MOVED = (0.75, 0.8, 0.85, 0.9, 0.95, 0.98, 1.02, 1.05, 1.1, 1.15, 1.2, 1.27, 1.35)
"""Start values of the search for a shifted resonance, relative to its frequency."""
TURNS = 4
"""Number of linearisations of a search for a change that is not linear."""
UNCERTAIN = 0.6
"""Share of the remaining error that can resemble a change. The remaining error counts at least as the floor."""


def half_interval(account: Account, name: str, jackknife: float) -> float:
    """Half 95 % interval of a linear change: that of the jackknife, and what the error that remains allows."""
    alike = UNCERTAIN * np.sqrt(max(1.0, account.cost)) / account.scale[account.names.index(name)]
    return float(np.hypot(jackknife, alike))


@dataclass(frozen=True, eq=False, slots=True)
class Explanation:
    """An account, and the search with the model around which it is linearised.

    Where a form was fitted beside the size, `per_error` is by how much the size may differ per RMS error, and
    `added` is (model, size) → the model with this form.
    """

    search: ChangeSearch
    account: Account
    moved: float = 0.0
    per_error: float = 0.0
    added: Callable[[Model, float], Model] | None = None

    @property
    def size(self) -> float:
        """Size of the change, in the unit of its kind."""
        return self.moved + self.account.size

    def alike(self, before: float) -> float:
        """Half interval of the size due to the remaining error; `before` is V without the change."""
        left = max(1.0, self.account.cost)
        alone = abs(self.size) / float(np.sqrt(max(before - self.account.cost, 1e-12)))
        return UNCERTAIN * float(np.sqrt(left)) * max(alone, self.per_error)


def moved_resonance(search: ChangeSearch, model: Model) -> Explanation:
    """The resonance at another frequency."""
    name = f"{ExtraResonance.name}.f0"
    before = model.values()[name]

    def about(moved: float) -> Explanation:
        near = search.around(model.with_values({name: before + moved}))
        return Explanation(near, near.best("resonance"), moved)

    best = min((about((share - 1.0) * before) for share in MOVED), key=lambda e: e.account.cost)
    return _settled(about, best, (-0.5 * before, before))


def low_pass_before(search: ChangeSearch, model: Model, lag: float) -> Explanation:
    """A low-pass before the hysteresis; its time constant is about the lag of one behind it [s]."""

    def about(tau: float) -> Explanation:
        near = search.around(shaped_model(model, "low_pass_before", tau))
        return Explanation(near, near.best("low_pass_before"), tau)

    present = amplifier_of(model)
    most = AmplifierBandwidth.parameters[0].upper - (present["tau"] if present else 0.0)
    return _settled(about, about(min(lag, most)), (0.1 * min(lag, most), most))


def _settled(about: Callable[[float], Explanation], best: Explanation, limits: tuple[float, float]) -> Explanation:
    """The change with the least cost from a start. It is linear only near the solution, so the search iterates.

    It explains nothing if the last step leads out of its range, to a time constant or a frequency that does not exist.
    """
    for _ in range(TURNS):
        again = about(float(np.clip(best.size, *limits)))
        if again.account.cost >= best.account.cost:
            break
        best = again
    exists = limits[0] <= best.size <= limits[1]
    return best if exists else replace(best, account=replace(best.account, cost=np.inf))
