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

"""The minimum of a quadratic function inside bounds satisfies the conditions of Karush, Kuhn and Tucker."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from piezo_hysteresis.identification.fit.bounded_step import bounded_step


def problem(seed, size, bounded):
    """A positive definite matrix in uneven units, a slope, and bounds around zero for some of the numbers."""
    rng = np.random.default_rng(seed)
    units = 10.0 ** rng.uniform(-4.0, 4.0, size)
    rows = rng.standard_normal((2 * size, size)) * units
    lower, upper = (np.where(rng.random(size) < bounded, rng.uniform(0.0, 0.3, size), np.inf) / units for _ in range(2))
    return rows.T @ rows, rows.T @ rng.standard_normal(2 * size) * 3.0, -lower, upper


@given(st.integers(0, 10**6), st.integers(1, 12), st.sampled_from([0.0, 0.3, 0.7, 1.0]))
def test_no_direction_inside_the_bounds_leads_further_down(seed, size, bounded):
    hessian, slope, lower, upper = problem(seed, size, bounded)
    step = bounded_step(hessian, slope, lower, upper)
    unit = np.sqrt(np.diag(hessian))
    uphill = (hessian @ step - slope) / unit
    room = 1e-6 * np.linalg.norm(slope / unit)
    at_lower, at_upper = ((step - lower) * unit < room, (upper - step) * unit < room)
    assert np.all(step >= lower - 1e-9 / unit) and np.all(step <= upper + 1e-9 / unit)
    assert np.all(uphill[~at_upper] > -room) and np.all(uphill[~at_lower] < room)


def test_of_a_direction_that_is_not_determined_nothing_is_changed():
    """Two numbers of which only the sum acts, beside one with a bound."""
    rows = np.array([[1.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 1.0, 1.0]])
    hessian, slope = rows.T @ rows, rows.T @ np.array([1.0, 5.0, 1.0])
    no = np.full(3, np.inf)
    free = bounded_step(hessian, slope, -no, no)
    assert free[0] == pytest.approx(free[1])
    held = bounded_step(hessian, slope, -no, np.array([np.inf, np.inf, 0.5]))
    assert held == pytest.approx([0.375, 0.375, 0.5])
