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

"""Scores on data that were not fitted, by cross-validation over records, computed from inner products.

Leaving one record out needs the solution of one small linear system: the parameters take the Gauss-Newton step of the
other records, and the record left out is judged with it. No record has to be simulated again.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np

from ...blocks.block import Array
from .normal_equations import Gram

RIDGE = 1e-9
"""Relative size below which a direction of the parameters counts as undetermined and is not changed."""
TINY = 1e-200
"""Inner product below which a direction counts as zero."""
SPOILT = 0.2
"""Error from noise alone, in R², from which a record is not left out."""
FARTHEST = 100.0
"""Largest ratio of R² with a record left out to R² of the fit to all; above it the linearisation is invalid."""


@dataclass(frozen=True, eq=False, slots=True)
class Score:
    """Errors of the records that were left out, relative to their floors.

    Parameters
    ----------
    ratios : (r,) ndarray
        RMS residual over floor of every record, R.
    step : (q,) ndarray
        Linearised change of the parameters from all records.
    """

    ratios: Array
    step: Array

    @property
    def excess(self) -> float:
        """V: mean of R²; 1 is the floor."""
        return float(np.mean(self.ratios**2))

    @property
    def logs(self) -> Array:
        """ln max(1, R²) of every record; the logarithm limits the influence of a single bad record."""
        return np.log(np.maximum(1.0, self.ratios**2))

    @property
    def cost(self) -> float:
        """C: mean of `logs`."""
        return float(self.logs.mean())

    def better_than(self, other: Score) -> tuple[float, float]:
        """Mean gain in C over `other`, and its standard error with records as units."""
        gain = other.logs - self.logs
        return float(gain.mean()), float(gain.std(ddof=1) / np.sqrt(gain.size)) if gain.size > 1 else np.inf


def cross_validate(
    grams: Sequence[Gram],
    floors: Sequence[float] | Array,
    columns: Array,
    alone: Collection[int] = (),
    room: tuple[Array | float, Array | float] = (-np.inf, np.inf),
) -> Score:
    """Score of a model extended by `columns`; every record is judged with parameters from the others.

    Parameters
    ----------
    grams : sequence of Gram
        Inner products of the records, with the same rows in all.
    floors : (r,) array_like
        Floor of every record [m]; records with an infinite floor only determine the state of the stage.
    columns : (rows, q) ndarray
        Directions of the parameters as combinations of the rows of `grams`; zero in the last row, the residual.
    alone : collection of int
        Indices of records that are the only ones of their kind; they are judged with the parameters from all records.
    room : tuple of two (q,) array_like
        Smallest and largest step along every direction. A direction at a bound is held there if the records together
        pull it outwards: an amplifier does not lead, even where a negative time constant would improve the prediction.
    """
    counted, products = _counted(grams, floors)
    hessians = np.array([columns.T @ p @ columns for p in products])
    slopes = np.array([columns.T @ p[:, -1] for p in products])
    power = np.array([p[-1, -1] for p in products])
    hessian, slope = hessians.sum(axis=0), slopes.sum(axis=0)
    low, high = room
    while True:
        scale = _scale(hessian)
        step = _solve(hessian[None], slope[None], scale)[0]
        outwards = ((step < 0.0) & (low >= 0.0)) | ((step > 0.0) & (high <= 0.0))
        if not outwards.any():
            break
        for sums in (hessians, hessian, slopes, slope):
            sums[..., outwards] = 0.0
        hessians[:, outwards], hessian[outwards] = 0.0, 0.0
    left = np.array([i not in alone for i in counted], dtype=float) * (len(counted) > 1)
    steps = _solve(hessian - left[:, None, None] * hessians, slope - left[:, None] * slopes, scale)
    changes = np.einsum("rj,rjk,rk->r", steps, hessians, steps) - 2.0 * np.sum(steps * slopes, axis=1)
    squares = np.clip(power + changes, 0.0, FARTHEST * np.maximum(1.0, power))
    return Score(np.sqrt(squares), step)


def indispensable(grams: Sequence[Gram], floors: Sequence[float] | Array, columns: Array) -> tuple[int, ...]:
    """Indices of records without which a direction of the parameters is not determined well enough to judge them.

    For example, the only rest at a high level is the only record that shows how a stage settles there. If a record of n
    samples contains the share μ of the information about a direction, noise of the other records adds μ/(1 − μ)/n to
    its R² when it is left out. The arguments are those of `cross_validate`.
    """
    counted, products = _counted(grams, floors)
    hessians = [columns.T @ product @ columns for product in products]
    total = np.sum(hessians, axis=0)
    scale = _scale(total)
    values, vectors = np.linalg.eigh(total * np.outer(scale, scale))
    known = values > RIDGE * values[-1]
    if not known.any():
        return ()
    whitened = vectors[:, known] / np.sqrt(values[known]) * scale[:, None]
    shares = [float(np.linalg.eigvalsh(whitened.T @ h @ whitened)[-1]) for h in hessians]
    return tuple(i for i, share in zip(counted, shares, strict=True) if share > SPOILT * grams[i].size * (1.0 - share))


def _counted(grams: Sequence[Gram], floors: Sequence[float] | Array) -> tuple[list[int], list[Array]]:
    """Indices of the records with a finite floor, and their inner products in units of the squared floor."""
    counted = [i for i, floor in enumerate(floors) if np.isfinite(floor)]
    return counted, [grams[i].matrix / (grams[i].size * floors[i] ** 2) for i in counted]


def _scale(hessian: Array) -> Array:
    """Unit of every direction; 0 for a direction without influence, whose square may be negative by rounding."""
    power = np.diag(hessian)
    return np.where(power > TINY, 1.0 / np.sqrt(np.maximum(power, TINY)), 0.0)


def _solve(matrices: Array, rights: Array, scale: Array) -> Array:
    """Solutions (r, q) of r normal equations; undetermined directions stay at zero."""
    values, vectors = np.linalg.eigh(matrices * np.outer(scale, scale))
    known = values > RIDGE * np.maximum(values[:, -1:], 1e-300)
    along = np.einsum("rjk,rj->rk", vectors, scale * rights)
    parts = np.divide(along, values, out=np.zeros_like(along), where=known)
    return np.asarray(scale * np.einsum("rjk,rk->rj", vectors, parts))
