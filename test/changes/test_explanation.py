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

"""Changes that are linear only near the solution explain records by numbers that exist, or not at all."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.changes import PERIOD, played
from benchmarks.nanopositioner import Nanopositioner
from piezo_hysteresis.changes.change_search import ChangeSearch
from piezo_hysteresis.changes.explanation import low_pass_before
from piezo_hysteresis.identification.identify import identify
from piezo_hysteresis.identification.records.noise_floor import floors

STAGE = Nanopositioner(mode=310.0, delay=2e-4, pole=2e-4)


@pytest.fixture(scope="module")
def model():
    return identify(played(STAGE, triangles=False), memory=True).model


@pytest.mark.parametrize(("late", "explains"), [(0.1, True), (-0.1, False), (-0.3, False)])
def test_a_response_that_is_earlier_has_no_low_pass_with_a_negative_time_constant(model, late, explains):
    records = played(replace(STAGE, noise_seed=1, delay=STAGE.delay + late * PERIOD), triangles=False).records
    search = ChangeSearch(model, records, range(len(records)), floors(records))
    found = low_pass_before(search, model, 0.01 * PERIOD)
    assert np.isfinite(found.account.cost) == explains
    assert not explains or 0.5 * late * PERIOD < found.size < 2.0 * late * PERIOD
