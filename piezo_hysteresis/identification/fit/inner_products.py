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

"""`inner_products` of the rows of two matrices, most of the work of a fit."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...blocks.kernel import IS_COMPILED, summing

Array = NDArray[np.float64]

TILE = 512
"""Number of samples that are processed together, so that they stay in the cache."""


def inner_products(first: Array, order: NDArray[np.intp], second: Array) -> Array:
    """Inner products of the rows `order` of `first` (m, n), followed by the rows of `second` (k, n).

    Parameters
    ----------
    first, second : (m, n) and (k, n) ndarray
        Rows of one length.
    order : (q,) ndarray
        Indices of rows of `first`.

    Returns
    -------
    (q + k, q + k) ndarray
        The lower triangle. Numbers above it have no meaning.

    Examples
    --------
    >>> np.tril(inner_products(np.eye(3), np.array([2, 0]), np.ones((1, 3))))
    array([[1., 0., 0.],
           [0., 1., 0.],
           [1., 1., 3.]])
    """
    if not IS_COMPILED:
        rows = np.concatenate((first[order], second))
        return np.asarray(rows @ rows.T)
    size = order.size + len(second)
    total = np.zeros((size + -size % 4,) * 2)
    add_inner_products(np.ascontiguousarray(first), order, np.ascontiguousarray(second), total)
    return total[:size, :size]


@summing
def add_inner_products(first: Array, order: NDArray[np.intp], second: Array, total: Array) -> None:
    """Lower triangle of total (p, p) += `inner_products`, with rows of zeros up to p, which is a multiple of 4.

    4 × 2 inner products at once stay in the registers of the processor.
    """
    kept, n = order.size, first.shape[1]
    rows = np.zeros((total.shape[0], TILE))
    for start in range(0, n, TILE):
        size = min(TILE, n - start)
        for r in range(kept):
            rows[r, :size] = first[order[r], start : start + size]
        for r in range(second.shape[0]):
            rows[kept + r, :size] = second[r, start : start + size]
        for i in range(0, total.shape[0], 4):
            x0, x1, x2, x3 = rows[i, :size], rows[i + 1, :size], rows[i + 2, :size], rows[i + 3, :size]
            for j in range(0, i + 4, 2):
                y0, y1 = rows[j, :size], rows[j + 1, :size]
                s00 = s01 = s10 = s11 = s20 = s21 = s30 = s31 = 0.0
                for k in range(size):
                    s00 += x0[k] * y0[k]
                    s01 += x0[k] * y1[k]
                    s10 += x1[k] * y0[k]
                    s11 += x1[k] * y1[k]
                    s20 += x2[k] * y0[k]
                    s21 += x2[k] * y1[k]
                    s30 += x3[k] * y0[k]
                    s31 += x3[k] * y1[k]
                total[i, j] += s00
                total[i, j + 1] += s01
                total[i + 1, j] += s10
                total[i + 1, j + 1] += s11
                total[i + 2, j] += s20
                total[i + 2, j + 1] += s21
                total[i + 3, j] += s30
                total[i + 3, j + 1] += s31
