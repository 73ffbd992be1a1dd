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

"""Turning points of a drive, and what both callers make of the two ends."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from piezo_hysteresis.identification.records import steady_waves
from piezo_hysteresis.recording.segmentation.swing_shapes import COARSEST, turning_points
from piezo_hysteresis.turning_points import find_turns

GROWING = np.linspace(0.0, 1.0, 4000) * np.sin(np.linspace(0.0, 12.0 * np.pi, 4000))
"""Sine of growing amplitude: six periods."""
LEAST = 0.3
"""Smallest swing [V]."""


def extremes(signal: np.ndarray) -> list[int]:
    """Samples that are larger or smaller than both neighbours."""
    slope = np.sign(np.diff(signal))
    return (np.flatnonzero(slope[1:] != slope[:-1]) + 1).tolist()


def found(signal: np.ndarray, from_first: bool) -> list[int]:
    """Turning points of the plain Python function."""
    turns = [0] * signal.size
    return turns[: find_turns(signal.tolist(), LEAST, from_first, turns)]


def test_from_the_first_sample_only_what_leaves_it_is_a_swing() -> None:
    assert found(GROWING, True) == [at for at in extremes(GROWING) if abs(GROWING[at]) > LEAST]


def test_between_two_extremes_a_swing_begins_earlier() -> None:
    at = extremes(GROWING)
    large = [b for a, b in itertools.pairwise(at) if abs(GROWING[b] - GROWING[a]) > LEAST]
    assert found(GROWING, False) == large
    assert len(large) == len(found(GROWING, True)) + 2


@pytest.mark.parametrize("from_first", [False, True])
def test_the_compiled_function_finds_the_same(from_first: bool) -> None:
    turns = np.empty(GROWING.size, np.int64)
    count = steady_waves.find_turns(GROWING, LEAST, from_first, turns)
    assert turns[:count].tolist() == found(GROWING, from_first)


def test_a_recording_counts_both_ends() -> None:
    assert turning_points(GROWING, LEAST).tolist() == [0, *found(GROWING, True), GROWING.size - 1]


def test_a_long_recording_has_the_same_turning_points() -> None:
    long = np.interp(np.arange(5 * COARSEST) * (GROWING.size - 1.0) / (5 * COARSEST - 1), np.arange(4000.0), GROWING)
    ratio = (5 * COARSEST - 1) / (GROWING.size - 1.0)
    assert np.allclose(turning_points(long, LEAST), ratio * turning_points(GROWING, LEAST), atol=ratio)
