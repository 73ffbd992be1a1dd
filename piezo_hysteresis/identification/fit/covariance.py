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

"""`covariance`: uncertainty of a joint fit, for residuals that are neither white nor of equal variance."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ...model.model import Model
from ...record import Record
from .normal_equations import Gram, Nuisance, residuals

Array = NDArray[np.float64]

BLOCKS = 64
"""Number of blocks of a residual whose means show its colour."""
UNKNOWN = 1e-10
"""Relative curvature below which a direction of the parameters is undetermined; it gets the variance of this value."""


def covariance(
    model: Model,
    records: Sequence[Record],
    nuisance: Nuisance | None,
    current: Sequence[Gram],
    floors: Array,
    directions: Array,
) -> Array:
    """Sandwich covariance (q, q): every record has its own residual variance and colour.

    Parameters
    ----------
    model : Model
        Fitted model.
    records : sequence of Record
        Fitted records.
    nuisance : Nuisance or None
        Disturbances that are free in every record.
    current : sequence of Gram
        Inner products at the fitted parameters.
    floors : (r,) ndarray
        Floor of every record [m].
    directions : (q, p) ndarray
        Directions in which the q parameters may change.

    Notes
    -----
    Computed in the eigenvectors of the normal equations with unit diagonal, to avoid cancellation and negative
    variances. A parameter without influence has variance 0.
    """
    weights = [1.0 / (g.size * f * f) for g, f in zip(current, floors, strict=True)]
    inner = [directions.T @ g.matrix[:-1, :-1] @ directions for g in current]
    bread = sum(w * m for w, m in zip(weights, inner, strict=True))
    meat = np.zeros_like(bread)
    for w, m, e in zip(weights, inner, residuals(model, records, nuisance), strict=True):
        variance = e @ e / max(1.0, e.size - directions.shape[1] / len(records))
        meat += w * w * variance * colour(e) * m
    return sandwich(bread, meat, directions)


def sandwich(bread: Array, meat: Array, directions: Array) -> Array:
    """Covariance (q, q) of the parameters: ``D B⁻¹ M B⁻¹ Dᵀ``.

    Parameters
    ----------
    bread : (p, p) ndarray
        Normal equations B along the directions.
    meat : (p, p) ndarray
        Covariance M of their right-hand side.
    directions : (q, p) ndarray
        Directions D in which the q parameters may change.
    """
    diagonal = np.diag(bread)
    scale = np.divide(
        1.0, np.sqrt(np.abs(diagonal)), out=np.zeros(diagonal.size), where=diagonal > np.finfo(float).tiny
    )
    values, vectors = np.linalg.eigh(bread * np.outer(scale, scale))
    least = UNKNOWN * values[-1]
    known = values > least
    vectors = scale[:, None] * vectors
    determined, free = vectors[:, known], directions @ vectors[:, ~known]
    spread, axes = np.linalg.eigh(determined.T @ meat @ determined)
    half = directions @ (determined / values[known]) @ (axes * np.sqrt(np.clip(spread, 0.0, None)))
    power = float(np.mean(scale**2 * np.diag(meat)))  # of the right-hand side, per curvature
    free *= np.sqrt(power / least) if least > 0.0 else 0.0
    return np.asarray(half @ half.T + free @ free.T)


def colour(residual: Array) -> float:
    """Ratio of the slow part of a residual to that of white noise of the same variance, at least 1.

    It is the variance of block means over its value for white noise. Values up to 1.7 (three standard deviations for 64
    blocks) count as white.
    """
    length = residual.size // BLOCKS
    if length < 2:
        return 1.0
    means = residual[: BLOCKS * length].reshape(BLOCKS, length).mean(axis=1)
    ratio = float(means.var() * length / max(residual.var(), 1e-300))
    return ratio if ratio > 1.7 else 1.0
