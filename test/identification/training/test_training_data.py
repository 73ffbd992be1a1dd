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

"""Which parameters the records of a diagnosis determine, and which of the records report the gap."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from piezo_hysteresis.effects import Arx, BoucWen, Offset
from piezo_hysteresis.effects.extent import Extent
from piezo_hysteresis.identification.training.adjusted_numbers import adjusted_numbers
from piezo_hysteresis.identification.training.training_data import TrainingData, choose_test_records
from piezo_hysteresis.model.model import Model
from piezo_hysteresis.record import Record

KINDS = ("noise", "sine_1hz", "sine_50hz", "triangle", "staircase", "validation")
STAGE = Model((BoucWen(A=-0.2, beta=3.0), Arx(a=(-0.5,), b=(0.5,)), Offset()), 1e-4, 50.0, 1e-5)


@pytest.mark.parametrize(("begins", "free"), [((0.0, 0.0), False), ((0.0, 0.01), False), ((0.0, 45.0), True)])
def test_settling_is_free_only_where_records_begin_at_different_levels(begins, free):
    records = tuple(Record(u + np.linspace(0.0, 50.0, 100), np.zeros(100), 1e-4) for u in begins)
    training_data = TrainingData(records, np.ones(2), Extent.of(records, STAGE.voltage_scale, STAGE.displacement_scale))
    assert ("offset.settling" in adjusted_numbers(STAGE, training_data)) is free
    assert "offset.y0" in adjusted_numbers(STAGE, training_data)


def records(phases):
    return [Record(np.arange(3.0), np.arange(3.0), 1e-3, phase=p) for p in phases]


@given(st.lists(st.sampled_from(KINDS), min_size=1, max_size=30))
def test_every_kind_stays_in_the_fit_and_validation_never_is(phases):
    kept = records(phases)
    spared = choose_test_records(kept, range(len(kept)))
    fitted = {p.split("_")[0] for i, p in enumerate(phases) if i not in spared}
    kinds = {p.split("_")[0] for p in phases}
    if kinds == {"validation"}:
        assert spared == ()
    else:
        assert fitted == kinds - {"validation"}
        assert {i for i, p in enumerate(phases) if p == "validation"} <= set(spared)


def test_validation_is_fitted_if_nothing_else_moves():
    rest = Record(np.zeros(3), np.zeros(3), 1e-3, phase="rest")
    assert choose_test_records([*records(["validation"] * 4), rest], range(5)) == ()


def test_one_in_three_of_a_kind_and_not_its_extremes():
    phases = [f"sine_{f}hz" for f in (1, 50, 100, 200, 300, 400)] + ["noise", "noise"]
    assert choose_test_records(records(phases), range(8)) == (1, 4)


def test_unusable_records_are_not_test_records():
    phases = ["noise"] * 6
    assert set(choose_test_records(records(phases), (0, 2, 4))) <= {0, 2, 4}
