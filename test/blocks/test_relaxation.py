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

"""The bank of relaxations for many rows side by side, against the one for a row after the other."""

from __future__ import annotations

import numpy as np
import pytest

from piezo_hysteresis.blocks.relaxation import LANES, TILE, hold, relax, relax_side_by_side


@pytest.mark.parametrize("rows", [1, 8, 19])
@pytest.mark.parametrize("cuts", [(), (1, TILE - 1, 2 * TILE)])
def test_rows_side_by_side_have_the_bits_of_single_rows(rows: int, cuts: tuple[int, ...]) -> None:
    rng = np.random.default_rng(rows)
    u = rng.normal(size=(rows, 3 * TILE)).cumsum(axis=1)
    bank = hold(np.geomspace(1e-3, 1e2, 3 * LANES), 1e-3)
    weights, rest = rng.normal(size=3 * LANES), rng.normal(size=(rows, 1 + 3 * LANES))
    expected, after = np.empty_like(u), rest.copy()
    relax(u, bank.fade, bank.lead, weights[None, :], after, expected[None, :])
    parts, state = [], rest.copy()
    for part in np.split(u, cuts, axis=1):
        parts.append(np.empty_like(part))
        relax_side_by_side(part.copy(), bank.fade, bank.lead, weights, state, parts[-1])
    np.testing.assert_array_equal(np.concatenate(parts, axis=1), expected)
    np.testing.assert_array_equal(state, after)
