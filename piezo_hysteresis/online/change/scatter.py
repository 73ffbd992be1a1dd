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

"""`Scatter`: how the scores of an unchanged stage vary under one class of drive."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from .false_alarm_threshold import WINDOW, inflation
from .misfit import SMALLEST, first_misfit, further_misfit, scale_of
from .score import GROUPS, ChangeScore

Array = NDArray[np.float64]

DISTINCT = 1e-6
"""A group counts as excited if at least this share of its sensitivity remains after its mean was subtracted."""

SLOWEST_DECAY = 0.98
"""Largest ratio between the correlations of scores at successive lags; it is a correlation time of 5 s."""

FEWEST_WINDOWS = 4
"""Fewest windows of scores of one class from which a drift of the misfit is estimated; they have at most `WINDOW`."""

TURNS = 3
"""Number of times that misfit and covariance are computed in turn."""

SMALLEST_ROOT = 1e-5
"""Eigenvectors of a slope are ignored if the root of their eigenvalue is below this share of the largest root."""

_TINY = float(np.finfo(np.float64).tiny)
"""Smallest divisor; it prevents a division by zero."""


@dataclass(frozen=True, eq=False, slots=True)
class Scatter:
    """Mean, covariance and correlation of the scores of one class of drive.

    Under a slow drive, the slope M of the scores differs from block to block, and so does their covariance. Scores
    divided by the matrix root of M have the same covariance in every block if the residual is white noise, and nearly
    the same if it is not.

    Parameters
    ----------
    count : int
        Number of scores.
    misfit : (5,) ndarray
        Change of the groups with which the gradients have a mean of zero: a systematic error of the model under this
        drive. It does not count as a change of the stage.
    precision : (5, 5) ndarray
        Inverse covariance of the scores divided by the matrix roots of their slopes [1/m²]; rows and columns of groups
        that are not excited are zero.
    slope : (5, 5) ndarray
        Mean of `ChangeScore.slope`.
    memory : (2, 5) ndarray
        First row: correlation between successive gradients of each group. Second row: factor by which the correlation
        falls with every further score.
    wander : (5,) ndarray
        Variance of the apparent change of each group between windows of at most `WINDOW` scores, minus the variance
        that the other numbers explain: the systematic error of the model drifts.
    power : float
        Mean square of the residual about its mean [m²].
    """

    count: int
    misfit: Array
    precision: Array
    slope: Array
    memory: Array
    wander: Array
    power: float

    @property
    def excited(self) -> NDArray[np.bool_]:
        """Groups that the drive excites, shape (5,)."""
        return np.diag(self.precision) > 0.0

    @property
    def scale(self) -> Array:
        """Square root of the diagonal of `slope`, shape (5,); 1 where it is zero."""
        return scale_of(self.slope)

    @property
    def weight(self) -> Array:
        """Fisher information of a typical score about each group, shape (5,)."""
        return np.diag(self.gradient(ChangeScore(np.zeros(len(GROUPS)), self.slope, 0.0, 0.0, 0, 0.0))[1])

    @property
    def independent(self) -> float:
        """Number of independent scores that know the variance of a long sum as well."""
        return self.count / float(self.inflation(WINDOW)[-1].max())

    def gradient(self, score: ChangeScore) -> tuple[Array, Array]:
        """Gradient of the log likelihood of a score with respect to the groups (5,), and its Fisher information (5, 5).

        The mean of the gradient is zero while nothing changes, and the information times θ after a change θ.
        """
        root, inverse = _roots(score.slope, self.scale, np.flatnonzero(self.excited))
        weighting = root @ self.precision @ inverse
        return weighting @ (score.value - score.slope @ self.misfit), weighting @ score.slope

    def gradients(self, scores: Sequence[ChangeScore]) -> tuple[Array, Array]:
        """`gradient` of several scores, of shape (n, 5), and their information, of shape (n, 5, 5)."""
        gradients, weights = zip(*map(self.gradient, scores), strict=True)
        return np.array(gradients), np.array(weights)

    def inflation(self, longest: int) -> Array:
        """Variance of the sum of 1, 2, … `longest` scores over that of independent scores, shape (longest, 5)."""
        return inflation(self.memory, longest)

    @classmethod
    def of(cls, scores: Sequence[ChangeScore]) -> Scatter:
        """Scatter of the scores of one class."""
        slope = np.mean([s.slope for s in scores], axis=0)
        scale, offset = scale_of(slope), GROUPS.index("offset")
        apart = np.diag(slope) - slope[:, offset] ** 2 / slope[offset, offset]
        kept = np.flatnonzero((apart > DISTINCT**2 * np.diag(slope)) | (np.arange(len(GROUPS)) == offset))
        misfit, none = first_misfit(np.array([s.value for s in scores]), slope, kept), np.zeros((2, len(GROUPS)))
        bare = cls(len(scores), misfit, np.zeros_like(slope), slope, none, none[0], residual_power(scores))
        for _ in range(TURNS):  # the weights depend on the misfit, and the misfit on the weights
            bare = replace(bare, precision=_precision(scores, bare.misfit, scale, kept))
            bare = replace(bare, misfit=bare.misfit + further_misfit(*bare.gradients(scores), scale))
        gradients, weights = bare.gradients(scores)
        own = np.sqrt(np.maximum(np.diagonal(weights, axis1=1, axis2=2), _TINY))
        known = replace(bare, memory=_memory(gradients / own))
        size = min(WINDOW, len(scores) // FEWEST_WINDOWS)
        return replace(known, wander=_wander(gradients, weights, known.inflation(size)[-1], size))


def beside_offset(gradients: Array, weights: Array) -> tuple[Array, Array]:
    """Gradients (n, 5) and information (n, 5) of sums of scores about each group, if the offset is not known.

    Every slow drift of the zero and every error of the creep moves the offset. In a part of a scan an offset resembles
    each of the other groups. That of the offset itself is not changed. `weights` has the shape (n, 5, 5).
    """
    offset = GROUPS.index("offset")
    common, own = weights[:, :, offset], np.diagonal(weights, axis1=1, axis2=2)
    known = own[:, offset, None]
    share = common / np.where(known > 0.0, known, np.inf)
    share[:, offset] = 0.0
    left = own - share * common
    return gradients - share * gradients[:, offset, None], np.where(left > DISTINCT * own, left, 0.0)


def residual_power(scores: Sequence[ChangeScore]) -> float:
    """Mean square of the residual of several blocks about its mean [m²]."""
    return float(np.mean([s.power for s in scores]) - np.mean([s.offset for s in scores]) ** 2)


def _roots(slope: Array, scale: Array, kept: NDArray[np.intp]) -> tuple[Array, Array]:
    """Root of a slope, times the scale, and the inverse of this product; both (5, 5), zero outside the kept rows."""
    values, vectors = np.linalg.eigh((slope / scale[:, None] / scale)[np.ix_(kept, kept)])
    size = np.sqrt(np.maximum(values, 0.0))
    there = size > SMALLEST_ROOT * size.max(initial=_TINY)
    root, inverse = np.zeros_like(slope), np.zeros_like(slope)
    inner = np.ix_(kept, kept)
    root[inner] = scale[kept][:, None] * ((vectors * np.where(there, size, 0.0)) @ vectors.T)
    inverse[inner] = ((vectors * np.where(there, 1.0 / np.where(there, size, 1.0), 0.0)) @ vectors.T) / scale[kept]
    return root, inverse


def _precision(scores: Sequence[ChangeScore], misfit: Array, scale: Array, kept: NDArray[np.intp]) -> Array:
    """`Scatter.precision` about a misfit."""
    precision = np.zeros((len(GROUPS), len(GROUPS)))
    biased = (len(scores) - kept.size - 2) / (len(scores) - 1)  # mean of the inverse of a Wishart matrix
    inverse = np.linalg.pinv(_even_covariance(scores, misfit, scale, kept), rcond=SMALLEST, hermitian=True)
    precision[np.ix_(kept, kept)] = biased * inverse
    return precision


def _even_covariance(scores: Sequence[ChangeScore], misfit: Array, scale: Array, kept: NDArray[np.intp]) -> Array:
    """Covariance of the scores divided by the roots of their slopes [m²], shape (k, k).

    In a block that does not excite a direction, this direction gets the mean variance of the excited ones. Otherwise
    the first block that excites it would count as a change.
    """
    even, excited = [], []
    for s in scores:
        root, inverse = _roots(s.slope, scale, kept)
        even.append((inverse @ (s.value - s.slope @ misfit))[kept])
        excited.append(((root / scale[:, None]) @ (inverse * scale))[np.ix_(kept, kept)])
    seen = np.array(even)
    mean = np.sum((seen - seen.mean(axis=0)) ** 2) / np.trace(np.sum(excited, axis=0))
    unexcited = np.eye(kept.size) - np.mean(excited, axis=0)
    return np.atleast_2d(np.cov(seen, rowvar=False)) + mean * unexcited


def _memory(series: Array) -> Array:
    """`Scatter.memory` of a series (n, 5).

    The decay is zero where the first correlation, at most (1 + decay) / 2, is not above two standard errors.
    """
    power = np.maximum((series**2).mean(axis=0), _TINY)
    one, two = ((series[lag:] * series[:-lag]).mean(axis=0) / power for lag in (1, 2))
    lasting = one > 2.0 / np.sqrt(len(series))
    decay = np.where(lasting, np.clip(two / np.where(lasting, one, 1.0), 0.0, SLOWEST_DECAY), 0.0)
    return np.vstack((np.clip(one, 0.0, (1.0 + decay) / 2.0), decay))


def _wander(gradients: Array, weights: Array, inflation: Array, size: int) -> Array:
    """`Scatter.wander` from the gradients (n, 5) and weights (n, 5, 5); 0 where noise explains the variance."""
    windows = len(gradients) // size
    sums = (x[: windows * size].reshape(windows, size, *x.shape[1:]).sum(axis=1) for x in (gradients, weights))
    gradient, weight = beside_offset(*sums)
    seen = (weight > 0.0).all(axis=0)
    weight = np.where(seen, weight, 1.0)
    expected = (inflation / weight).mean(axis=0) * (1.0 + 2.0 * np.sqrt(2.0 / (windows - 1)))
    return np.where(seen, np.maximum(0.0, np.var(gradient / weight, axis=0, ddof=1) - expected), 0.0)
