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

"""`other_filters`: filters whose form has no name of its own, described by poles together with a delay.

A filter of higher order, a moving average, and a low-pass in series with a delay all begin to respond later than a
low-pass of first or second order that delays slow signals as much.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from ...effects import SecondOrderLowPass
from ...model.model import Model
from ..change_search import ChangeSearch
from ..explanation import Explanation
from ..signatures import ChangeablePrediction, filtered_by, shaped_model, with_low_pass
from .filtered_signal import derivatives, filtered, shifted

Array = NDArray[np.float64]

OTHER = "other_filter"
"""Key of the change."""
DAMPING = next((p.lower, p.upper) for p in SecondOrderLowPass.parameters if p.name == "zeta")
"""Range of the damping ratio of two poles."""
LAGS, SHARES = (0.3, 3.0), (0.0, 0.95)
"""Range of the lag, relative to that of a form with a name, and of its shares."""
TURNS = 15
"""Largest number of linearisations."""
STEP, SETTLED = 1e-3, 1e-4
"""Relative step of a difference quotient, and of a search that has converged."""


@dataclass(frozen=True, slots=True)
class OtherFilter:
    """One pole or none, two poles or none, and a delay.

    Parameters
    ----------
    delay : float
        Share of the delay in the lag.
    pole : float
        Share of the pole in the rest; the other two poles have what is left.
    zeta : float
        Damping ratio of the two poles.
    """

    delay: float
    pole: float
    zeta: float

    def times(self, lag: float) -> tuple[float, float, float]:
        """The delay and the time constants of the pole and of the two poles, which together have a lag [s]."""
        rest = (1.0 - self.delay) * lag
        return self.delay * lag, self.pole * rest, (1.0 - self.pole) * rest / (2.0 * self.zeta)

    def __call__(self, prediction: ChangeablePrediction, signal: Array, before: float, lag: float) -> Array:
        """A signal of the record behind the filter with a lag [s]."""
        late, one, two = self.times(lag)
        period = prediction.record.sample_period
        signal = filtered_by(prediction, signal, before, two, self.zeta)
        if one > 0.0:
            signal = filtered(derivatives(signal, before), before, period, one)
        return shifted(derivatives(signal, before), late / period)

    def in_model(self, model: Model, lag: float) -> Model:
        """A model with the filter behind it."""
        late, one, two = self.times(lag)
        model = with_low_pass(model, two, self.zeta) if two > 0.0 else model
        model = with_low_pass(model, one) if one > 0.0 else model
        return shaped_model(model, "delay", late)


def other_filters(search: ChangeSearch, lag: float) -> list[Explanation]:
    """The best filters of one, two and three poles with a delay, the best first; their lag is about `lag` [s]."""
    found = [
        _fitted(search, lag, (0.3,), (SHARES,), lambda delay: OtherFilter(delay, 1.0, 1.0)),
        _fitted(search, lag, (0.3, 0.8), (SHARES, DAMPING), lambda delay, zeta: OtherFilter(delay, 0.0, zeta)),
        _fitted(search, lag, (0.25, 0.3, 0.8), (SHARES, SHARES, DAMPING), OtherFilter),
    ]
    return sorted(found, key=lambda e: e.account.cost)


def _fitted(
    search: ChangeSearch,
    lag: float,
    start: Sequence[float],
    ranges: Sequence[tuple[float, float]],
    form: Callable[..., OtherFilter],
) -> Explanation:
    """The filter with the smallest remaining error, by least squares for its lag and its form."""

    def about(x: Array) -> ChangeSearch:
        return search.with_shape(OTHER, form(*x[1:].tolist()))

    def left(x: Array) -> Array:
        return about(x).fitted(OTHER, lag * float(x[0]))[1]

    bounds = tuple(np.transpose((LAGS, *ranges)))
    found = scipy.optimize.least_squares(
        left, (1.0, *start), bounds=bounds, diff_step=STEP, xtol=SETTLED, ftol=SETTLED, max_nfev=TURNS
    )
    near = about(found.x)
    account = near.account(OTHER, lag * float(found.x[0]))
    free = found.active_mask == 0
    slopes = found.jac[:, free]
    unsure = lag * float(np.sqrt(np.linalg.pinv(slopes.T @ slopes, hermitian=True)[0, 0])) if free[0] else np.inf
    return Explanation(near, account, per_error=unsure, added=form(*found.x[1:].tolist()).in_model)
