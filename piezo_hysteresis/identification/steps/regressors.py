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

"""Least squares of ARX by an orthogonal factorisation of its regressors, delayed copies of the input and the output.

Neighbouring samples of a stage are almost equal, so inner products of the regressors, with their squared condition
number, would not determine the coefficients.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import lapack

from ...errors import IdentificationError
from ...record import Samples

Array = NDArray[np.float64]
Signals = Sequence[tuple[Samples, Samples]]
"""Input and output of every record, at one sample period."""

BLOCK = 1 << 11
"""Number of rows of the regressor matrix in memory; they stay in the processor's cache."""


def triangle(signals: Signals, orders: tuple[int, int], delay: int) -> Array:
    """R, upper triangular, of [−y_(i−1) … −y_(i−na), u_(i−d) … u_(i−d−nb+1), y_i], without the offset of every record.

    Parameters
    ----------
    signals : sequence of (u, y)
        Input and output of every record.
    orders : (int, int)
        na and nb.
    delay : int
        d, samples.

    Returns
    -------
    (na + nb + 1, na + nb + 1) ndarray
        R; RᵀR contains the inner products of the columns.

    Raises
    ------
    IdentificationError
        If a record is shorter than the orders.
    """
    na, nb = orders
    first = max(na, delay + nb - 1)
    for _, y in signals:
        if y.size <= first:
            raise IdentificationError(
                f"ARX: got a record of {y.size} samples, expected more than {first} for its orders"
            )
    size = na + nb + 1
    rows = np.zeros((size + BLOCK, size), order="F")  # the factor so far, and a block below it
    for u, y in signals:
        end = y.size
        columns = [y[first - k : end - k] for k in range(1, na + 1)]
        columns += [u[first - delay - k : end - delay - k] for k in range(nb)]
        columns.append(y[first:])
        means = [column.mean() for column in columns]
        for start in range(0, end - first, BLOCK):
            count = min(BLOCK, end - first - start)
            for k, (column, mean) in enumerate(zip(columns, means, strict=True)):
                np.subtract(column[start : start + count], mean, out=rows[size : size + count, k])
            rows[size : size + count, :na] *= -1.0
            factor = lapack.dgeqrf(rows[: size + count])[0]
            rows[:size] = np.triu(factor[:size])
    return np.ascontiguousarray(rows[:size])
