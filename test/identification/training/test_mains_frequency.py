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

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from piezo_hysteresis.effects.extent import MAINS
from piezo_hysteresis.identification.training.mains_frequency import mains_frequency
from piezo_hysteresis.record import Record

FLOOR = 1e-9


def hum(frequency, phases, period=1e-3, size=4000, amplitude=5 * FLOOR, beside=None):
    """Residuals with hum of a phase of its own and white noise [m], and records without drive."""
    rng, t = np.random.default_rng(1), period * np.arange(size)
    left = []
    for phase in phases:
        wave = np.sin(2 * np.pi * frequency * t + phase) + 0.2 * np.sin(6 * np.pi * frequency * t + 2 * phase)
        left.append(amplitude * wave + FLOOR * rng.normal(size=size) + (0.0 if beside is None else beside(t)))
    return [Record(0.0 * t, e, period) for e in left], left


def estimated(nominal, records, left):
    return mains_frequency(nominal, records, left, np.full(len(records), FLOOR))


@settings(max_examples=20, deadline=None)
@given(
    nominal=st.sampled_from(MAINS),
    deviation=st.floats(-0.15, 0.15),
    phases=st.lists(st.floats(0.0, 6.2), min_size=4, max_size=6),
)
def test_the_frequency_is_found_although_every_record_has_a_phase_of_its_own(nominal, deviation, phases):
    assert estimated(nominal, *hum(nominal + deviation, phases)) == pytest.approx(nominal + deviation, abs=3e-3)


def test_a_record_in_which_much_else_is_missing_counts_little():
    """A drive at 50 Hz, wrongly simulated in one record, is not the mains of the other five."""
    records, left = hum(50.06, np.arange(5.0))
    driven = 1e3 * FLOOR * np.sin(2 * np.pi * 50.0 * 1e-3 * np.arange(4000))
    left.append(left[0] + driven)
    assert estimated(50.0, [*records, records[0]], left) == pytest.approx(50.06, abs=0.01)


def test_a_creep_that_is_much_larger_hardly_moves_it():
    records, left = hum(59.96, np.arange(5.0), beside=lambda t: 300 * FLOOR * np.log1p(t / 0.01))
    assert estimated(60.0, records, left) == pytest.approx(59.96, abs=0.01)


def test_it_is_nominal_where_no_record_shows_the_mains():
    records, left = hum(50.1, np.arange(3.0), period=1e-2)
    assert estimated(50.0, records, left) == 50.0
    assert estimated(60.0, [], []) == 60.0
