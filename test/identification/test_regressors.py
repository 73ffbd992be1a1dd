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

"""The triangle of the ARX regressors is that of their orthogonal factorisation, written out in full."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from piezo_hysteresis.errors import IdentificationError
from piezo_hysteresis.identification.steps.regressors import triangle


def written_out(signals, na, nb, delay):
    """Inner products of the regressors, every column of every record about its mean."""
    first, total = max(na, delay + nb - 1), np.zeros((na + nb + 1,) * 2)
    for u, y in signals:
        rows = np.array(
            [
                [*(-y[i - k] for k in range(1, na + 1)), *(u[i - delay - k] for k in range(nb)), y[i]]
                for i in range(first, y.size)
            ]
        )
        rows -= rows.mean(axis=0)
        total += rows.T @ rows
    return total


@given(st.integers(0, 4), st.integers(1, 4), st.integers(1, 5), st.integers(0, 2**32 - 1))
def test_the_triangular_factor_contains_the_inner_products_of_all_records(na, nb, delay, seed):
    random = np.random.default_rng(seed)
    signals = [(random.normal(3.0, 1.0, n), random.normal(-20.0, 1.0, n)) for n in (30, 4700)]
    r = triangle(signals, (na, nb), delay)
    expected = written_out(signals, na, nb, delay)
    np.testing.assert_allclose(r.T @ r, expected, rtol=1e-9, atol=1e-9 * expected.max())
    assert np.array_equal(r, np.triu(r))


def test_nearly_dependent_regressors_keep_what_distinguishes_them():
    """A sine is a combination of two of its own delays: inner products of them are singular to rounding."""
    time = np.arange(9000.0)
    signals = [(np.sin(0.01 * time), 0.3 * np.sin(0.01 * (time - 4.0)) + 1e-9 * np.cos(time))]
    r = triangle(signals, (3, 3), 1)
    expected = written_out(signals, 3, 3, 1)
    np.testing.assert_allclose(r.T @ r, expected, atol=1e-12 * expected.max())
    assert abs(r[-1, -1]) < 1e-6 * abs(r[0, 0])


def test_record_shorter_than_the_orders_is_refused():
    with pytest.raises(IdentificationError, match="got a record of 9 samples, expected more than 10"):
        triangle([(np.zeros(9), np.zeros(9))], (2, 8), 3)
