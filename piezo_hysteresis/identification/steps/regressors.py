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

"""Least squares of ARX from inner products: the regressors are delayed copies of the same signals.

The sum over all samples of x_(i−j) z_(i−k) differs from that of x_(i−j+1) z_(i−k+1) by one product at each end, so all
inner products follow from one row and one column. If the squared condition number is too large, an orthogonal
factorisation of the regressors is used instead.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray
from scipy.linalg import cholesky, qr

from ...blocks.kernel import kernel
from ...errors import IdentificationError
from ...record import Samples

Array = NDArray[np.float64]
Signals = Sequence[tuple[Samples, Samples]]
"""Input and output of every record, at one sample period."""

BLOCK = 1 << 13
"""Number of rows of the regressor matrix in memory."""
INDEPENDENT = 1e-9
"""Smallest eigenvalue of the correlation matrix from which products determine θ, to 1e-7 or better."""


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
    first = max(orders[0], delay + orders[1] - 1)
    for _, y in signals:
        if y.size <= first:
            raise IdentificationError(
                f"ARX: got a record of {y.size} samples, expected more than {first} for its orders"
            )
    total = np.sum([_inner_products(u, y, orders, delay) for u, y in signals], axis=0)
    scale = np.sqrt(np.diag(total))
    if scale.min() > 0.0:
        correlation = total / np.outer(scale, scale)
        if np.linalg.eigvalsh(correlation)[0] > INDEPENDENT:
            return np.asarray(cholesky(correlation) * scale)
    return _factorised(signals, orders, delay)


def _inner_products(u: Samples, y: Samples, orders: tuple[int, int], delay: int) -> Array:
    """Inner products of the columns of one record, without their means."""
    na, nb = orders
    first = max(na, delay + nb - 1)
    shifted = np.concatenate((np.zeros(delay), u[: u.size - delay] - u.mean()))
    y = y - y.mean()
    both = _lagged(y, shifted, na + 1, nb, first)
    products = np.block(
        [[_lagged(y, y, na + 1, na + 1, first), both], [both.T, _lagged(shifted, shifted, nb, nb, first)]]
    )
    ones = np.ones(y.size)
    sums = np.concatenate((_lagged(y, ones, na + 1, 1, first), _lagged(shifted, ones, nb, 1, first)))
    products -= sums @ sums.T / (y.size - first)
    columns = np.roll(np.arange(na + nb + 1), -1)  # y_i last
    sign = np.where(columns <= na, -1.0, 1.0)
    sign[-1] = 1.0
    return np.asarray(np.outer(sign, sign) * products[np.ix_(columns, columns)])


def _lagged(x: Array, z: Array, rows: int, columns: int, first: int) -> Array:
    """Σ x_(i−j) z_(i−k) over i = first … n − 1, for j < rows, k < columns."""
    n = x.size
    sums = np.empty((rows, columns))
    sums[0] = [x[first:] @ z[first - k : n - k] for k in range(columns)]
    sums[1:, 0] = [x[first - j : n - j] @ z[first:] for j in range(1, rows)]
    _continue_diagonals(x, z, first, sums)
    return sums


@kernel
def _continue_diagonals(x: Array, z: Array, first: int, sums: Array) -> None:
    """Every sum from the one of the lags before it; the first row and the first column are given."""
    n = x.size
    for j in range(1, sums.shape[0]):
        for k in range(1, sums.shape[1]):
            sums[j, k] = sums[j - 1, k - 1] + x[first - j] * z[first - k] - x[n - j] * z[n - k]


def _factorised(signals: Signals, orders: tuple[int, int], delay: int) -> Array:
    """R by orthogonal factorisation, block by block."""
    na, nb = orders
    first = max(na, delay + nb - 1)
    r = np.zeros((0, na + nb + 1))
    for u, y in signals:
        # row i contains y_i, y_(i−1), …
        past_y = sliding_window_view(y[first - na :], na + 1)[:, ::-1]
        past_u = sliding_window_view(u[first - delay - nb + 1 : u.size - delay], nb)[:, ::-1]
        means = np.concatenate((past_y.mean(axis=0), past_u.mean(axis=0)))
        for start in range(0, y.size - first, BLOCK):
            part = slice(start, start + BLOCK)
            block = np.hstack((past_y[part], past_u[part])) - means
            block = np.hstack((-block[:, 1 : na + 1], block[:, na + 1 :], block[:, :1]))
            r = qr(np.vstack((r, block)), mode="r", overwrite_a=True, check_finite=False)[0][: na + nb + 1]
    return r
