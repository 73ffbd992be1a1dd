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

"""Plays: the memory of turning points."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from piezo_hysteresis.effects import Backlash, Discretisation, Effect, HysteresisMemory
from piezo_hysteresis.errors import ParameterError

SETTING = Discretisation(1e-3, 1e-3)


def run(effect: Effect, x: np.ndarray) -> np.ndarray:
    block = effect.block(SETTING)
    return block.run(x, block.rest(x[0], 0.0))[0]


levels = st.lists(st.floats(-1.0, 1.0), min_size=2, max_size=50)


@settings(max_examples=50)
@given(levels, st.floats(0.0, 0.5))
def test_backlash_never_leaves_its_play_and_moves_only_when_pushed(x: list[float], b: float) -> None:
    drive = np.array(x)
    y = run(Backlash(b=b), drive)
    assert (np.abs(y - drive) <= b + 1e-15).all()
    moved = np.diff(y) != 0
    np.testing.assert_allclose(np.abs(y - drive)[1:][moved], b, atol=1e-15)
    assert (np.sign(np.diff(y)[moved]) == np.sign(np.diff(drive)[moved])).all()


def test_backlash_has_no_output_below_its_half_width() -> None:
    x = 2.0 + 0.05 * np.sin(np.arange(200) / 7.0)
    np.testing.assert_array_equal(run(Backlash(b=0.06), x), np.full(200, 2.0))


@settings(max_examples=40)
@given(levels)
def test_memory_is_the_weighted_sum_of_plays(x: list[float]) -> None:
    effect = HysteresisMemory(c=[0.3, 0.1, 0.2], reach=0.4)
    drive = np.array(x)
    parts = [c * run(Backlash(b=r), drive) for c, r in zip(effect.array("c"), effect.radii, strict=True)]
    np.testing.assert_allclose(run(effect, drive), sum(parts), atol=1e-15)


@settings(max_examples=40)
@given(levels, st.floats(-0.5, 1.0), st.floats(0.0, 1.0), st.floats(0.0, 1.0))
def test_a_closed_minor_loop_returns_to_the_point_where_it_left(
    x: list[float], top: float, down: float, up: float
) -> None:
    bottom = top - down * (top + 1.0)
    turn = bottom + up * (top - bottom)
    path = np.array([*x, -1.0, top, bottom, turn, bottom, top])
    y = run(HysteresisMemory(c=np.full(8, 0.1)), path)
    np.testing.assert_allclose(y[-1], y[-5], atol=1e-14)
    np.testing.assert_allclose(y[-2], y[-4], atol=1e-14)


@given(st.lists(st.floats(-1.0, 1.0), max_size=4), st.floats(-1.0, 1.0))
def test_a_stage_that_was_driven_before_rests_in_the_state_of_that_drive(turns: list[float], v: float) -> None:
    plays = HysteresisMemory(c=(0.3, 0.1, 0.2), reach=0.4, virgin=1.0)
    block = plays.block(SETTING)
    _, state = block.run(np.array([*turns, v]), block.rest(0.0, 0.0))
    driven = plays.with_values(turns=tuple(turns)).block(SETTING)
    np.testing.assert_allclose(driven.rest(v, 0.0), state, atol=1e-15)
    assert driven.static(v) == pytest.approx(plays.array("c") @ state)


def test_one_play_is_refused() -> None:
    with pytest.raises(ParameterError, match="expected at least 2"):
        HysteresisMemory(c=[0.1])
