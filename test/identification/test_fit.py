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

"""The joint fit: what its cost counts."""

import numpy as np
import pytest

from piezo_hysteresis.effects import Arx, BoucWen
from piezo_hysteresis.identification.fit.fit import fit
from piezo_hysteresis.model.model import Model
from piezo_hysteresis.record import Record

STAGE = Model((BoucWen(), Arx(a=(), b=(1.0,), delay=1.0)), 1e-3, 10.0, 1e-5)


@pytest.mark.parametrize("before", [0, 3])
def test_records_that_only_determine_the_state_are_not_counted_in_the_cost(before):
    """A noise of one floor costs 1, however many records without weight come first."""
    u = 5.0 - 5.0 * np.cos(0.02 * np.arange(1000))
    still = [Record(u, u, 1e-3, start_time=float(k), continues=k > 0) for k in range(before + 2)]
    noise = 1e-8 * np.random.default_rng(0).normal(size=(len(still), u.size))
    moved = zip(still, STAGE.free_run(still), noise, strict=True)
    records = [Record(u, y + e, 1e-3, start_time=r.start_time, continues=r.continues) for r, y, e in moved]
    found = fit(STAGE, records, ["bouc_wen.p1", "bouc_wen.p2"], floors=[np.inf] * before + [1e-8] * 2)
    assert found.cost == pytest.approx(1.0, rel=0.1)
    assert found.converged
