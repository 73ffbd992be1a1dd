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

"""Which parameters the records of a diagnosis determine, and which are therefore free."""

import numpy as np
import pytest

from piezo_hysteresis.discrepancy.search.candidates import adjusted_numbers
from piezo_hysteresis.discrepancy.search.training_data import TrainingData
from piezo_hysteresis.effects import Arx, BoucWen, Offset
from piezo_hysteresis.effects.extent import Extent
from piezo_hysteresis.identification.fit.normal_equations import Nuisance
from piezo_hysteresis.model.model import Model
from piezo_hysteresis.record import Record

STAGE = Model((BoucWen(A=-0.2, beta=3.0), Arx(a=(-0.5,), b=(0.5,)), Offset()), 1e-4, 50.0, 1e-5)


@pytest.mark.parametrize(("begins", "free"), [((0.0, 0.0), False), ((0.0, 0.01), False), ((0.0, 45.0), True)])
def test_settling_is_free_only_where_records_begin_at_different_levels(begins, free):
    records = tuple(Record(u + np.linspace(0.0, 50.0, 100), np.zeros(100), 1e-4) for u in begins)
    training_data = TrainingData(
        records, np.ones(2), Nuisance(), Extent.of(records, STAGE.voltage_scale, STAGE.displacement_scale)
    )
    assert ("offset.settling" in adjusted_numbers(STAGE, training_data)) is free
    assert "offset.y0" in adjusted_numbers(STAGE, training_data)
