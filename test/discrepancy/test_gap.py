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

"""The gap: closed forms, on the records asked for and no others."""

import numpy as np
import pytest

from piezo_hysteresis.discrepancy.gap import Gap, PhaseGap, measure_gap
from piezo_hysteresis.effects import Arx, BoucWen, Offset
from piezo_hysteresis.model.model import Model
from piezo_hysteresis.record import Record

MODEL = Model((BoucWen(), Arx(b=[0.25]), Offset()), sample_period=1e-3, displacement_scale=2e-5)
ERRORS = (1e-8, 3e-8, 5e-8)
STROKE = 1e-5


@pytest.fixture(scope="module")
def records():
    """What MODEL would have answered, off by a known square wave."""
    found = []
    for size in ERRORS:
        u = 5 - 5 * np.cos(2 * np.pi * 1e-3 * np.arange(2000))
        wave = size * np.where(np.arange(2000) % 2, 1.0, -1.0)
        bare = Record(u, np.zeros(2000), 1e-3, phase="sine_1hz")
        found.append(Record(u, MODEL.simulate(bare)[0] + wave, 1e-3, phase="sine_1hz"))
    return found


def measure(records, models, chosen, offset=False):
    return measure_gap(models, records, chosen, [2e-8] * 3, STROKE, unseen=True, offset=offset)


def test_the_gap_is_rms_over_range_with_equal_weights(records):
    gap = measure(records, (MODEL, MODEL), (0, 2))
    assert [p.after for p in gap.per_phase] == pytest.approx([0.1, 0.5])
    assert gap.after == pytest.approx(np.sqrt((0.1**2 + 0.5**2) / 2))
    assert gap.before == gap.after
    assert gap.floor == pytest.approx(0.2)
    assert gap.interval_95[0] <= gap.after <= gap.interval_95[1]


def test_before_and_after_belong_to_the_two_models(records):
    shifted = MODEL.with_effect(Offset(y0=2e-8))
    gap = measure(records, (shifted, MODEL), (0,))
    assert gap.before == pytest.approx(np.sqrt(0.1**2 + 0.2**2))
    assert gap.after == pytest.approx(0.1)


def test_free_disturbances_are_not_part_of_the_gap(records):
    shifted = MODEL.with_effect(Offset(y0=2e-8))
    gap = measure(records, (shifted, MODEL), (0,), offset=True)
    assert gap.before == pytest.approx(gap.after)


def test_the_interval_of_few_records_is_that_of_student(records):
    """Two records: 12.7 standard errors, where many records would have 1.96."""
    gap = measure(records, (MODEL, MODEL), (0, 2))
    error = (0.5**2 - 0.1**2) / 2
    assert gap.interval_95[1] ** 2 == pytest.approx(gap.after**2 + 12.706 * error, rel=1e-3)
    assert measure(records, (MODEL, MODEL), (1,)).interval_95 is None


def test_the_share_is_measured_on_the_records_of_the_gap(records):
    """The error of one model is 100 nm and that of the other 40 nm; the floor is 20 nm, and the noise 10 nm."""
    far, near = (MODEL.with_effect(Offset(y0=zero)) for zero in (1e-7, 4e-8))
    first, second = ((size**2 + 1e-16) / 4e-16 for size in (1e-7, 4e-8))
    gap = measure(records, (far, near), (0,))
    assert gap.explained == pytest.approx(1.0 - np.sqrt((second - 1.0) / (first - 1.0)))
    assert measure(records, (far, MODEL), (0,)).explained == 1.0


@pytest.mark.parametrize(
    ("before", "after", "falls"),
    [(4.0, 3.8, False), (4.0, 3.4, True), (1.2, 1.19, True), (1.2, 1.2, False)],
    ids=["too little", "enough", "little at the floor", "nothing at the floor"],
)
def test_a_gap_above_the_floor_falls_if_a_tenth_of_the_squares_is_removed(before, after, falls):
    row = PhaseGap("sine", 0, np.sqrt(before), np.sqrt(after), 1.0)
    assert Gap(row.before, row.after, 1.0, None, (row,), True, row.after).falls is falls
