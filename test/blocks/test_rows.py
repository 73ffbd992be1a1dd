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

"""Rows of sensitivities, which a chain keeps in one array, and blocks that do not change them."""

from __future__ import annotations

import numpy as np
import pytest

from piezo_hysteresis.blocks.block import Block, SumBlock
from piezo_hysteresis.blocks.fir import FirBlock
from piezo_hysteresis.blocks.low_pass import LowPassBlock, held_step, linear_step
from piezo_hysteresis.effects import Arx, BoucWen, Creep, Discretisation, GainDrift, HysteresisMemory, Offset

SETTING = Discretisation(1e-3, 1e-3)
BLOCKS = {
    "creep, off": Creep().block(SETTING),
    "creep": Creep(gamma=0.1).block(SETTING),
    "arx": Arx(a=[-1.2, 0.6], b=[0.3, 0.1], delay=2).block(SETTING),
    "gain drift": GainDrift(g=0.1).block(SETTING),
    "offset": Offset(settling=0.1).block(SETTING),
    "sum": SumBlock((BoucWen().block(SETTING), HysteresisMemory().block(SETTING))),
}
X = 1.0 + np.random.default_rng(3).normal(scale=0.1, size=200).cumsum()


def linearised(block: Block, dx: np.ndarray) -> np.ndarray:
    return block.linearise(X.copy(), dx, block.rest(X[0], 0.0), block.rest_tangent(X[0], dx[:, 0].copy()))[1]


@pytest.mark.parametrize("name", BLOCKS)
@pytest.mark.parametrize("spare", [0, 1, 40])
def test_room_behind_the_rows_does_not_change_them(name: str, spare: int) -> None:
    dx = np.random.default_rng(4).normal(size=(3, X.size)).cumsum(axis=1)
    room = np.full((3 + spare, X.size), np.nan)
    room[:3] = dx
    np.testing.assert_array_equal(linearised(BLOCKS[name], room[:3]), linearised(BLOCKS[name], dx.copy()))


@pytest.mark.parametrize(
    "block", [LowPassBlock("tau", linear_step(0.0, 1e-3), 2), FirBlock(("delay",), 0, np.eye(1, 3)[0], np.ones((1, 3)))]
)
def test_a_filter_that_is_off_leaves_the_rows_and_the_output(block: Block) -> None:
    dx = np.random.default_rng(4).normal(size=(3, X.size))
    assert block.is_idle
    np.testing.assert_array_equal(linearised(block, dx.copy())[:3], dx)
    np.testing.assert_array_equal(block.run(X, block.rest(X[0], 0.0))[0], X)


def test_a_low_pass_that_is_too_fast_to_be_seen_passes_its_rows_to_a_record_in_which_it_is() -> None:
    slow, fast = (LowPassBlock("tau", held_step(1e-5, period), 2) for period in (1e-2, 1e-5))
    state, tangent = slow.rest(0.0, 0.0), slow.rest_tangent(0.0, np.zeros(1))
    assert slow.is_idle
    assert not fast.is_idle
    for block in (slow, fast):  # the row is x itself, so that it comes out as y
        y, rows, state, tangent = block.linearise(X, X[None, :].copy(), state, tangent)
        np.testing.assert_allclose(rows[0], y, rtol=1e-14)
