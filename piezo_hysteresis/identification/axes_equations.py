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

"""Least squares for impulse responses of several inputs and outputs, from records of any length."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..errors import IdentificationError

Array = NDArray[np.float64]

RIDGE = 1e-6
"""Regularisation for frequency bands that the drives do not excite, as a share of the diagonal."""


@dataclass(frozen=True, eq=False, slots=True)
class Regression:
    """Contribution of one record to the equations.

    Parameters
    ----------
    x : (n, f) array
        Regressors; zero before the first row.
    y : (n, p) array
        Measured displacements [m].
    first : int
        Index of the first row that is fitted.
    weight : float
        Weight of the squared errors of this record.
    """

    x: Array
    y: Array
    first: int = 0
    weight: float = 1.0


def require_samples(available: int, unknowns: int) -> None:
    """Raise IdentificationError if there are fewer samples than unknown taps of one displacement."""
    if available < unknowns:
        raise IdentificationError(
            f"got {available} samples for {unknowns} taps per displacement, expected more; "
            "record longer or identify with fewer taps"
        )


def impulse_responses(regressions: Iterable[Regression], length: int) -> tuple[Array, Array]:
    """Impulse responses h and zeros c with y(k) ≈ c + Σₗ h(l) x(k − l); every record has its own zero.

    Parameters
    ----------
    regressions : iterable of Regression
        Contributions with equal numbers of columns.
    length : int
        Number of lags, 1 or more.

    Returns
    -------
    h : (p, length, f) ndarray
        Impulse responses, the oldest sample first.
    c : (p,) ndarray
        Weighted mean of the zeros of the records [m].

    Raises
    ------
    IdentificationError
        If the records contain fewer samples than unknowns, or do not determine the unknowns.
    """
    from scipy.linalg import LinAlgError, solve

    parts = list(regressions)
    terms, outputs = parts[0].x.shape[1], parts[0].y.shape[1]
    require_samples(sum(max(0, len(part.x) - part.first) for part in parts), length * terms)
    matrix = np.zeros((length, terms, length, terms))
    right = np.zeros((length, terms, outputs))
    edges, signs, means, sizes, levels = [], [], [], [], []
    for part in parts:
        n = len(part.x) - part.first
        if n <= 0:
            continue
        padded = np.concatenate((np.zeros((length, terms)), part.x))
        begin, end = length + part.first, len(padded)
        total = np.zeros((length, terms))
        for lag in range(length):
            late = padded[begin - lag : end - lag]
            matrix[0, :, lag] += part.weight * (padded[begin:].T @ late)
            right[lag] += part.weight * (late.T @ part.y[part.first :])
            total[lag] = late.sum(axis=0)
        for last, sign in ((begin, part.weight), (end, -part.weight)):
            edges.append(padded[last - length : last][::-1])
            signs.append(sign)
        means.append(total / n)
        levels.append(part.y[part.first :].mean(axis=0))
        sizes.append(part.weight * n)
    edge, edge_weight = np.array(edges), np.array(signs)
    for lag in range(length - 1):  # a shift by one sample adds a row at the beginning and drops one at the end
        ends = np.tensordot(edge_weight[:, None] * edge[:, lag], edge[:, : length - 1], axes=(0, 0))
        matrix[lag + 1, :, 0] = matrix[0, :, lag + 1].T
        matrix[lag + 1, :, 1:] = matrix[lag, :, :-1] + ends
    flat, target = matrix.reshape(length * terms, -1), right.reshape(length * terms, outputs)
    mean, size, level = np.array(means).reshape(len(means), -1), np.array(sizes), np.array(levels)
    flat -= (mean.T * size) @ mean  # eliminates the zero of every record
    target -= (mean.T * size) @ level
    flat[np.diag_indices(len(flat))] *= 1.0 + RIDGE
    try:
        h = solve(flat, target, assume_a="pos", overwrite_a=True)
    except LinAlgError:
        raise IdentificationError(
            "the drives do not determine the responses: got drives that are constant or depend on one another, "
            "expected independent noise or multisines on all of them"
        ) from None
    zeros = np.average(level - mean @ h, axis=0, weights=size)
    return h.reshape(length, terms, outputs)[::-1].transpose(2, 0, 1).copy(), zeros
