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

"""Order of the ARX model: the smallest one whose free-run error on samples that were not fitted is near the best."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...effects import Arx
from .dynamics import Dynamics, reflected, solve
from .regressors import Signals, triangle


@dataclass(frozen=True, slots=True)
class OrderError:
    """Errors of one order na = nb: one-step error on the fitted data, free-run error on other data."""

    order: int
    one_step_error: float
    free_run_error: float


def compare_orders(signals: Signals, delay: int, sample_period: float, highest: int = 10) -> tuple[OrderError, ...]:
    """Error of the orders na = nb = 1 … `highest`, fitted to the first two thirds of every record, judged on the rest.

    Parameters
    ----------
    signals : sequence of (u, y)
        Input and output of every record.
    delay : int
        d, samples.
    sample_period : float
        Sample period [s].
    highest : int
        Highest order; its regressors include those of the lower orders.

    Returns
    -------
    tuple of OrderError
        Errors in rising order.
    """
    cuts = [2 * y.size // 3 for _, y in signals]
    early = [(u[:cut], y[:cut]) for (u, y), cut in zip(signals, cuts, strict=True)]
    regressors = triangle(early, (highest, highest), delay)
    table = []
    for order in range(1, highest + 1):
        theta, left = solve(regressors, np.r_[:order, highest : highest + order])
        a, b, _ = reflected(theta[:order], theta[order:])
        model = Dynamics(Arx(a=tuple(a.tolist()), b=tuple(b.tolist()), delay=delay), sample_period)
        late = [(y - model.simulate(u))[cut:] for (u, y), cut in zip(signals, cuts, strict=True)]
        free_run = float(np.std(np.concatenate([e - e.mean() for e in late])))
        table.append(OrderError(order, left / float(np.sqrt(sum(cuts))), free_run))
    return tuple(table)


def choose_order(table: Sequence[OrderError], slack: float = 0.01) -> int:
    """Smallest order whose free-run error is within `slack` of the best."""
    best = min(row.free_run_error for row in table)
    return next(row.order for row in table if row.free_run_error <= best * (1.0 + slack))
