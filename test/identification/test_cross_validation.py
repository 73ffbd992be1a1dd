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

"""Scores on data left out equal the brute-force way: fit without the record, then judge it."""

import numpy as np
import pytest

from piezo_hysteresis.identification.fit.cross_validation import Score, cross_validate, indispensable
from piezo_hysteresis.identification.fit.normal_equations import Gram

RANDOM = np.random.default_rng(5)
SIZES = (200, 500, 90, 300)
FLOORS = np.array([0.1, 0.3, 0.2, 0.1])


@pytest.fixture(scope="module")
def problem():
    """Design matrices and measurements of a linear problem, record by record."""
    truth = np.array([1.0, -2.0, 0.5])
    designs = [RANDOM.normal(size=(n, 3)) for n in SIZES]
    return designs, [x @ truth + f * RANDOM.normal(size=len(x)) for x, f in zip(designs, FLOORS, strict=True)]


def products(designs, measured):
    """As `grams` gives them, at parameters zero."""
    rows = [np.column_stack((x, y)).T for x, y in zip(designs, measured, strict=True)]
    return [Gram(r.shape[1], r @ r.T, np.empty(0)) for r in rows]


COLUMNS = np.vstack((np.eye(3), np.zeros((1, 3))))


def test_equals_fitting_without_the_record_that_is_judged(problem):
    designs, measured = problem
    score = cross_validate(products(designs, measured), FLOORS, COLUMNS)
    for left_out in range(len(SIZES)):
        others = [i for i in range(len(SIZES)) if i != left_out]
        weight = [1 / (FLOORS[i] * np.sqrt(SIZES[i])) for i in others]
        stacked = np.concatenate([w * designs[i] for w, i in zip(weight, others, strict=True)])
        wanted = np.concatenate([w * measured[i] for w, i in zip(weight, others, strict=True)])
        found = np.linalg.lstsq(stacked, wanted, rcond=None)[0]
        rms = np.sqrt(np.mean((measured[left_out] - designs[left_out] @ found) ** 2))
        assert score.ratios[left_out] == pytest.approx(rms / FLOORS[left_out], rel=1e-9)


def test_the_true_model_lies_at_the_floor(problem):
    score = cross_validate(products(*problem), FLOORS, COLUMNS)
    assert score.excess == pytest.approx(1.0, abs=0.2)
    np.testing.assert_allclose(score.step, [1.0, -2.0, 0.5], atol=0.05)


def test_a_direction_undetermined_by_the_other_records_is_not_changed(problem):
    designs, measured = problem
    only_here = [np.column_stack((x, np.full(len(x), float(i == 0)))) for i, x in enumerate(designs)]
    columns = np.vstack((np.eye(4), np.zeros((1, 4))))
    with_it = cross_validate(products(only_here, measured), FLOORS, columns)
    without = cross_validate(products(designs, measured), FLOORS, COLUMNS)
    assert with_it.ratios[0] == pytest.approx(without.ratios[0], rel=1e-9)


def test_the_only_record_that_determines_a_parameter_is_indispensable(problem):
    designs, measured = problem
    for informative, wanted in ((range(4), ()), ((2, 3), ()), ((2,), (2,))):
        seen = [
            np.column_stack((x, float(i in informative) * RANDOM.normal(size=len(x)))) for i, x in enumerate(designs)
        ]
        columns = np.vstack((np.eye(4), np.zeros((1, 4))))
        assert indispensable(products(seen, measured), FLOORS, columns) == wanted


def test_records_that_only_determine_the_state_do_not_count(problem):
    score = cross_validate(products(*problem), np.array([0.1, np.inf, 0.2, 0.1]), COLUMNS)
    assert score.ratios.size == 3


def test_no_single_bad_record_decides():
    good, bad = Score(np.array([1.0, 1.0, 1.0, 100.0]), np.empty(0)), Score(np.array([3.0] * 4), np.empty(0))
    assert good.excess > bad.excess
    assert good.cost == pytest.approx(np.log(1e4) / 4)
    gain, error = bad.better_than(good)
    assert gain == pytest.approx(good.cost - bad.cost)
    assert error == pytest.approx(np.std(good.logs - bad.logs, ddof=1) / 2)


def test_below_the_floor_nothing_is_gained():
    assert Score(np.array([0.2, 0.9]), np.empty(0)).cost == 0.0


def test_a_direction_at_its_bound_is_held_where_the_data_pull_it_outwards(problem):
    designs, measured = problem
    low, high = np.array([-np.inf, 0.0, -np.inf]), np.full(3, np.inf)
    score = cross_validate(products(designs, measured), FLOORS, COLUMNS, room=(low, high))
    others = cross_validate(products(designs, measured), FLOORS, COLUMNS[:, [0, 2]])
    assert score.step[1] == 0.0, "the data want -2"
    np.testing.assert_allclose(score.ratios, others.ratios, rtol=1e-9)
    inwards = cross_validate(products(designs, measured), FLOORS, COLUMNS, room=(-high, -low))
    np.testing.assert_array_equal(inwards.ratios, cross_validate(products(designs, measured), FLOORS, COLUMNS).ratios)
