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

"""Inner products of the rows of two matrices are those of numpy, for every number of rows and samples."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from piezo_hysteresis.identification.fit.inner_products import TILE, inner_products


@given(
    st.integers(0, 9), st.integers(0, 5), st.sampled_from([1, 7, TILE - 1, TILE, TILE + 1, 3 * TILE + 5]), st.randoms()
)
def test_they_are_those_of_numpy_in_the_wanted_order(kept, beside, size, random):
    rng = np.random.default_rng(random.randrange(1000))
    first, second = rng.normal(size=(kept + 2, size)), rng.normal(size=(beside, size))
    order = rng.permutation(kept + 2)[:kept]
    rows = np.concatenate((first[order], second))
    found = np.tril(inner_products(first, order, second))
    assert found == pytest.approx(np.tril(rows @ rows.T), abs=1e-11 * size)


def test_rows_may_be_parts_of_longer_rows():
    rows = np.arange(40.0).reshape(2, 20)
    found = inner_products(rows[:, 5:12], np.array([1]), rows[:1, 3:10])
    assert found[1, 0] == rows[1, 5:12] @ rows[0, 3:10]
    assert found[1, 1] == rows[0, 3:10] @ rows[0, 3:10]


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_a_sample_that_is_no_finite_number_shows_in_the_products_of_its_row(bad):
    """Fits and score tests take it for a divergence."""
    rows = np.ones((3, 600))
    rows[1, 555] = bad
    diagonal = np.diag(inner_products(rows, np.array([0, 1, 2]), rows[:1]))
    assert np.isfinite(diagonal).tolist() == [True, False, True, True]
