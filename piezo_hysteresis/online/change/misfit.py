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

"""The systematic error of a model that the scores of an unchanged stage show, as a change of the groups."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .score import GROUPS

Array = NDArray[np.float64]

SIGNIFICANT = 3.0
"""Smallest mean of a score, in standard errors, that counts as a systematic error of the model."""

BATCHES = 10
"""Number of successive parts of a baseline whose means give the standard error of the mean; scores are correlated."""

SMALLEST = 1e-10
"""Eigenvalues below this share of the largest count as zero."""

_TINY = float(np.finfo(np.float64).tiny)
"""Smallest divisor; it prevents a division by zero."""


def scale_of(slope: Array) -> Array:
    """Square root of the diagonal of a slope (5, 5), shape (5,); 1 where it is zero."""
    size = np.sqrt(np.diag(slope))
    return np.where(size > 0.0, size, 1.0)


def first_misfit(values: Array, slope: Array, kept: NDArray[np.intp]) -> Array:
    """`Scatter.misfit` of the scores `values` (n, 5) if their weights were equal.

    It holds the offset, and what the scores show of the other groups beside it. A direction whose mean is not
    significant has no misfit: divided by a small slope, its error would be a large misfit that other groups cancel, and
    the sum would count as a change as soon as the slopes are different.
    """
    scale, offset = scale_of(slope), GROUPS.index("offset")
    others = kept[kept != offset]
    inner, scores = slope / scale[:, None] / scale, values / scale
    common = inner[others, offset] / inner[offset, offset]
    strengths, directions = np.linalg.eigh(inner[np.ix_(others, others)] - np.outer(common, inner[offset, others]))
    along = (scores[:, others] - np.outer(scores[:, offset], common)) @ directions
    misfit = np.zeros(len(GROUPS))
    misfit[others] = directions @ _significant(along, strengths)
    misfit[offset] = (scores[:, offset].mean() - inner[offset] @ misfit) / inner[offset, offset]
    return misfit / scale


def further_misfit(gradients: Array, weights: Array, scale: Array) -> Array:
    """Change of the groups (5,) after which the sum of the gradients (n, 5) is zero; their weights are (n, 5, 5).

    Where scores and weights alternate, a mean score of zero leaves gradients that grow with the window as a change.
    """
    strengths, directions = np.linalg.eigh(weights.mean(axis=0) / scale[:, None] / scale)
    return np.asarray(directions @ _significant(gradients / scale @ directions, strengths) / scale)


def _significant(along: Array, strengths: Array) -> Array:
    """Change in each direction that explains the mean of scores (n, k) with these strengths (k,); 0 if in doubt."""
    means = np.array([part.mean(axis=0) for part in np.array_split(along, BATCHES)])
    error = means.std(axis=0, ddof=1) / np.sqrt(BATCHES)
    seen = (np.abs(along.mean(axis=0)) > SIGNIFICANT * error) & (strengths > SMALLEST * strengths.max(initial=_TINY))
    return np.where(seen, along.mean(axis=0) / np.where(seen, strengths, 1.0), 0.0)
