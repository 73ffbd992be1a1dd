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

"""A joint fit to pieces of records, with one sensor zero, which wanders, for all records that continue one another."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ...effects import Arx
from ...errors import DivergenceError, ParameterError
from ...model.model import Model
from ..fit.bounded_step import bounded_step, bounds_of, gauge, projected
from ..fit.normal_equations import grams
from ..fit.time_limit import check_time
from .pieces import WEIGHTS, RecordPiece
from .prior import WAVES, prior_of, slow_rows

Array = NDArray[np.float64]
Products = Callable[[Model, Sequence[str]], tuple[Array, Array]]
"""Matrices and weights as in `PieceFit`, for a model and its free numbers."""

STIFF = 1e-9
"""Damping that keeps undetermined directions at their start, as a share of the diagonal."""
FIRST_DAMPING = 1e-6
"""Damping of the first step, as a share of the diagonal."""
FARTHEST = 1e10
"""Damping at which the search gives up."""
LARGEST_POLE = 0.999
"""Largest radius of the pole of a lag."""
POLE, GAIN, DELAY = (f"{Arx.name}.{n}" for n in ("a[0]", "b[0]", "delay"))
"""Parameters of a lag."""
PERFECT = 1e-9
"""Cost at which the fit ends, because the model reproduces the data exactly."""
MOST = 25
"""Largest number of linearisations of a fit."""
CONVERGED = 1e-4
"""Relative decrease of the cost at which the fit ends."""


@dataclass(frozen=True, eq=False)
class PieceFit:
    """A model fitted to pieces, and the inner products at the fitted parameters.

    Parameters
    ----------
    model : Model
        Model with the fitted values.
    names : tuple of str
        Free numbers.
    matrices : (p, q + s + 1, q + s + 1) ndarray
        Inner products of every piece, divided by its number of samples and its squared noise floor: sensitivities of
        the q parameters, the s zeros and waves of the runs, and the residual.
    weights : (p,) ndarray
        Weights of the pieces; their sum is 1.
    converged : bool
        False if the limit of iterations was reached first.
    iterations : int
        Number of linearisations.
    """

    model: Model
    names: tuple[str, ...]
    matrices: Array
    weights: Array
    converged: bool = False
    iterations: int = 1

    @cached_property
    def cost(self) -> float:
        """Weighted mean of R² with fitted zeros and wander."""
        return float(self.total[-1, -1] - self.total[len(self.names) : -1, -1] @ self.slow)

    @cached_property
    def prior(self) -> Array:
        """The prior, in the form of the matrices."""
        return prior_of(self.model, self.names, self.matrices.shape[1] - 1 - len(self.names))

    @cached_property
    def total(self) -> Array:
        """Weighted sum of the matrices and the prior."""
        return np.asarray(np.tensordot(self.weights, self.matrices, 1) + self.prior)

    @cached_property
    def slow(self) -> Array:
        """Fitted zeros of the runs [m], then the amplitudes of the waves of their wander, shape (s,)."""
        total, numbers = self.total, len(self.names)
        matrix, cross = total[numbers:-1, numbers:-1], total[numbers:-1, -1]
        # zeros are lengths and waves have no unit; without scales, lstsq drops the waves of short strokes
        scale = 1.0 / np.sqrt(np.maximum(np.diag(matrix), np.finfo(float).tiny))
        return np.asarray(scale * np.linalg.lstsq(matrix * np.outer(scale, scale), scale * cross, rcond=None)[0])

    @property
    def runs(self) -> int:
        """Number of the runs of records that continue one another."""
        return (self.matrices.shape[1] - 1 - len(self.names)) // (1 + WAVES)

    @property
    def zeros(self) -> Array:
        """Fitted zeros of the runs [m], shape (r,)."""
        return self.slow[: self.runs]

    @cached_property
    def squares(self) -> Array:
        """R² of every piece, shape (p,)."""
        slow, own = self.slow, slice(len(self.names), -1)
        return np.array([m[-1, -1] - 2.0 * slow @ m[own, -1] + slow @ m[own, own] @ slow for m in self.matrices])

    def box(self) -> tuple[Array, Array]:
        """Distance of every parameter to its lower and upper bound; zeros are not bounded."""
        values = self.model.values()
        now = np.array([values[n] for n in self.names])
        zeros = np.full(self.matrices.shape[1] - 1 - now.size, np.inf)
        lower, upper = bounds_of(self.model, self.names)
        if POLE in self.names and self.model[Arx.name].array("a").size == 1:
            pole = self.names.index(POLE)
            lower[pole], upper[pole] = -LARGEST_POLE, 0.0
        return np.concatenate((lower - now, -zeros)), np.concatenate((upper - now, zeros))


def linearised(
    model: Model,
    pieces: Sequence[RecordPiece],
    floors: Sequence[float] | Array,
    names: Sequence[str],
    slow: Sequence[Array] | None = None,
) -> tuple[Array, Array]:
    """Matrices and weights of the used pieces, as in `PieceFit`; `slow` are the `slow_rows` of the pieces, if known."""
    slow = slow or slow_rows(pieces, model.displacement_scale)
    found = grams(model, [p.record for p in pieces], names, None, slow)
    counted = [i for i, p in enumerate(pieces) if WEIGHTS[p.kind] > 0.0]
    weights = np.array([pieces[i].weight for i in counted])
    for origin in {pieces[i].origin for i in counted}:
        mine = np.array([pieces[i].origin == origin for i in counted])
        weights[mine] /= weights[mine].sum()
    runs = sorted({pieces[i].run for i in counted})
    own, zeros = len(names), len(names) + len(runs)
    size = zeros + WAVES * len(runs) + 1
    matrices = np.zeros((len(counted), size, size))
    for matrix, i in zip(matrices, counted, strict=True):
        run = runs.index(pieces[i].run)
        waves = zeros + WAVES * run
        rows = [*range(own), own + run, *range(waves, waves + WAVES), size - 1]
        matrix[np.ix_(rows, rows)] = found[i].matrix / (found[i].size * floors[pieces[i].origin] ** 2)
    return matrices, weights / weights.sum()


def fit_pieces(
    model: Model,
    pieces: Sequence[RecordPiece],
    floors: Sequence[float],
    names: Sequence[str],
    max_iterations: int = MOST,
) -> PieceFit:
    """Fit the parameters `names` by damped Gauss-Newton steps inside their bounds.

    Parameters
    ----------
    model : Model
        Model with start values.
    pieces : sequence of RecordPiece
        Pieces in order.
    floors : sequence of float
        Floor of every record [m].
    names : sequence of str
        Free numbers.
    max_iterations : int
        Largest number of linearisations.

    Raises
    ------
    TimeSpentError
        If the time limit of the search has passed.
    """
    check_time()
    slow = slow_rows(pieces, model.displacement_scale)

    def products(model: Model, names: Sequence[str]) -> tuple[Array, Array]:
        return linearised(model, pieces, floors, names, slow)

    names, damping, is_doubtful = tuple(names), FIRST_DAMPING, False
    now = PieceFit(model, names, *products(model, names))
    while names and now.iterations < max_iterations and now.cost > PERFECT:
        better, refused = None, 0
        while better is None and damping < FARTHEST:
            better = _step(now, products, damping, is_doubtful or refused > 0)
            damping = max(damping * (10.0 if better is None else 0.1), 1e-9)
            refused += better is None
        is_doubtful = refused > 0
        if better is None:
            break
        gain = 1.0 - better.cost / now.cost
        now = better
        if gain < CONVERGED and damping <= 1.0:
            break
    converged = now.iterations < max_iterations
    return replace(now, converged=converged)


def _step(now: PieceFit, products: Products, damping: float, is_doubtful: bool) -> PieceFit | None:
    """The fit after a damped step; None if its cost is not lower. If that is likely, because a step before was refused,
    the cost is computed first without slopes, which take most of the time.
    """
    total, names = now.total, now.names
    step = best_step(now, total, damping)
    values = now.model.values()
    moved = np.clip([values[n] for n in names] + step[: len(names)], *bounds_of(now.model, names))
    try:
        model = now.model.with_values(dict(zip(names, moved.tolist(), strict=True)))
        if is_doubtful and not cost_of(model, names, products) < now.cost:
            return None
        matrices, weights = products(model, names)
    except (DivergenceError, ParameterError):
        return None
    moved_there = PieceFit(model, names, matrices, weights, iterations=now.iterations + 1)
    return moved_there if moved_there.cost < now.cost else None


def cost_of(model: Model, names: Sequence[str], products: Products) -> float:
    """Cost as in `PieceFit`, by a free run without slopes."""
    matrices, weights = products(model, ())
    own = PieceFit(model, (), matrices, weights)
    return own.cost + float(prior_of(model, names, matrices.shape[1] - 1)[-1, -1])


def best_step(now: PieceFit, total: Array, damping: float = 0.0) -> Array:
    """Least-squares change of parameters and zeros for `total`, a sum of matrices of pieces."""
    directions = free_directions(now)
    hessian, slope = projected(directions, total)
    diagonal = np.maximum(np.diag(hessian), 1e-30)
    # zeros and waves are linear and start at 0: held there by damping, they would turn the step of all other numbers
    damped = np.any(directions[: len(now.names)] != 0.0, axis=0)
    hessian = hessian + np.diag((damping * damped + STIFF) * diagonal)
    low, high = now.box()
    own = (directions == 1.0).argmax(axis=0)  # the parameter of the direction; G(1) is kept by others
    return np.asarray(directions @ bounded_step(hessian, slope, low[own] - 1e-300, high[own] + 1e-300))


def free_directions(now: PieceFit) -> Array:
    """Directions (q + r, d) in which parameters and zeros may change while G(1) is constant."""
    own = gauge(now.model, now.names)
    zeros = now.matrices.shape[1] - 1 - len(now.names)
    whole = np.zeros((own.shape[0] + zeros, own.shape[1] + zeros))
    whole[: own.shape[0], : own.shape[1]] = own
    whole[own.shape[0] :, own.shape[1] :] = np.eye(zeros)
    return whole
