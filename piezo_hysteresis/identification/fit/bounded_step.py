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

"""`bounded_step`: the minimum of a small quadratic function inside bounds; bounds and directions of steps of a fit."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy
from numpy.typing import NDArray
from scipy.linalg.lapack import dpocon, dpotrf, dpotrs

from ...effects import Arx
from ...model.model import Model

Array = NDArray[np.float64]

SMALLEST = 1e-14
"""Relative eigenvalue below which a direction is not changed after a bound was reached."""

REGULAR = 1e-12
"""Reciprocal condition above which a matrix is solved by its Cholesky factor, twenty times faster."""


def bounded_step(hessian: Array, slope: Array, lower: Array, upper: Array) -> Array:
    """Minimise ½ xᵀHx − sᵀx for lower ≤ x ≤ upper.

    Parameters
    ----------
    hessian : (q, q) ndarray
        H, positive definite.
    slope : (q,) ndarray
        s.
    lower, upper : (q,) ndarray
        Bounds, lower < upper; infinite for none.

    Returns
    -------
    (q,) ndarray
        x; exact also with many active bounds, as for non-negative weights.
    """
    # unit diagonal: columns differ by many orders of magnitude
    scale = 1.0 / np.sqrt(np.diag(hessian))
    matrix, target = hessian * np.outer(scale, scale), slope * scale
    free = scale * _solved(matrix, target)
    if np.all((free >= lower) & (free <= upper)):
        return np.asarray(free)
    bound = np.isfinite(lower) | np.isfinite(upper)  # the best of the others follows from these
    follows = _solved(matrix[~bound][:, ~bound], np.column_stack((target[~bound], -matrix[~bound][:, bound])))
    beside = matrix[bound][:, ~bound]
    values, vectors = np.linalg.eigh(matrix[bound][:, bound] + beside @ follows[:, 1:])
    known = values > SMALLEST * values[-1]
    root, vectors = np.sqrt(values[known]), vectors[:, known]
    goal = vectors.T @ (target[bound] - beside @ follows[:, 0]) / root
    box = (lower[bound] / scale[bound], upper[bound] / scale[bound])
    step = np.empty_like(target)
    step[bound] = scipy.optimize.lsq_linear(root[:, None] * vectors.T, goal, box, method="bvls").x
    step[~bound] = follows @ np.append(1.0, step[bound])
    return scale * step


def _solved(matrix: Array, target: Array) -> Array:
    """x of matrix · x = target for a symmetric matrix with unit diagonal; the smallest x if it is singular."""
    factor, failed = dpotrf(matrix)
    if not failed and matrix.size and dpocon(factor, np.abs(matrix).sum(axis=0).max())[0] > REGULAR:
        return np.asarray(dpotrs(factor, target)[0])
    return np.asarray(np.linalg.lstsq(matrix, target, rcond=1e-15)[0])


def projected(directions: Array, total: Array) -> tuple[Array, Array]:
    """H and s in some directions (q, d), from normal equations (q + 1, q + 1) whose last row and column are s.

    Beside slow poles, what the sums that keep G(1) leave of a curvature can be less than their rounding errors, even
    negative. H and s of such a direction are 0.
    """
    hessian, slope = directions.T @ total[:-1, :-1] @ directions, directions.T @ total[:-1, -1]
    sums = np.einsum("kd,kl,ld->d", *map(np.abs, (directions, total[:-1, :-1], directions)), optimize=True)
    lost = np.diag(hessian) <= np.finfo(float).eps * sums
    hessian[lost], hessian[:, lost], slope[lost] = 0.0, 0.0, 0.0
    return hessian, slope


def bounds_of(model: Model, names: Sequence[str]) -> tuple[Array, Array]:
    """Lower and upper bounds of parameters of a model."""
    rows = [model.row(n) for n in names]
    return np.array([r.lower for r in rows]), np.array([r.upper for r in rows])


def room_of(model: Model, names: Sequence[str], columns: Array) -> tuple[Array, Array]:
    """Smallest and largest step along every column before one of the parameters leaves its bounds."""
    values, moves = model.values(), columns[: len(names)]
    theta = np.array([values[n] for n in names])
    lower, upper = bounds_of(model, names)
    return _room(lower, theta, moves, -np.inf), _room(upper, theta, moves, np.inf)


def _room(limits: Array, theta: Array, directions: Array, open_end: float) -> Array:
    """Largest step along every direction; `open_end` if it changes several numbers."""
    far = np.full(directions.shape[1], open_end)
    for j, column in enumerate(directions.T):
        (moved,) = np.nonzero(column)
        if moved.size == 1:
            far[j] = limits[moved[0]] - theta[moved[0]]
    return far


def gauge(model: Model, names: Sequence[str]) -> Array:
    """Directions (q, r) in which the free parameters may change at constant G(1).

    If w is scaled by c, the gains of the hysteresis scale by c and b by 1/c, so one direction is not determined. If all
    of `b` is free, b1 follows from G(1) = B(1)/A(1).
    """
    directions = np.eye(len(names))
    if Arx.name not in model or not model.has_hysteresis:
        return directions
    b = [i for i, n in enumerate(names) if n.startswith(f"{Arx.name}.b[")]
    gains = {f"{model.hysteresis.name}.{n}" for n in model.hysteresis.linear_numbers()}
    if len(b) < len(model.effect(Arx).array("b")) or not gains.issubset(names):
        return directions
    directions[b[0], b[1:]] = -1.0
    for i, n in enumerate(names):
        if n.startswith(f"{Arx.name}.a["):
            directions[b[0], i] = model.effect(Arx).dc_gain
    return np.delete(directions, b[0], axis=1)
