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

"""The joint fit: what its cost counts, what it shares with a score, and when it ends."""

import importlib

import numpy as np
import pytest

from piezo_hysteresis.effects import Arx, BoucWen
from piezo_hysteresis.identification.fit.fit import STALLED, fit
from piezo_hysteresis.identification.fit.normal_equations import grams
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


def test_a_fit_from_a_known_linearisation_is_the_same():
    u = 5.0 - 5.0 * np.cos(0.02 * np.arange(1000))
    (y,) = STAGE.free_run([Record(u, u, 1e-3)])
    records, free = [Record(u, 1.02 * y, 1e-3)], ("bouc_wen.p1", "bouc_wen.p2", "bouc_wen.beta")
    whole, begun = fit(STAGE, records, free), fit(STAGE, records, free, max_iterations=2)
    ended = fit(begun.model, records, free, known=begun.linearised)
    anew = fit(begun.model, records, free)
    assert (ended.values, ended.cost, ended.iterations) == (anew.values, anew.cost, anew.iterations)
    assert ended.cost == pytest.approx(whole.cost, abs=1e-20)
    (again,) = grams(ended.model, records, free)
    assert np.array_equal(ended.linearised.grams[0].matrix, again.matrix)


def test_a_fit_ends_when_no_step_at_strong_damping_lowers_the_cost_noticeably(monkeypatch):
    """Behind an effect that is missing, fits crept on with strong damping until they reached their limit."""
    module = importlib.import_module("piezo_hysteresis.identification.fit.fit")

    def creeping(model, free, directions, hessian, slope, room):
        return 1e-9 * np.linalg.solve(hessian, slope) @ directions.T

    monkeypatch.setattr(module, "stable_step", creeping)
    u = 5.0 - 5.0 * np.cos(0.02 * np.arange(1000))
    (y,) = STAGE.free_run([Record(u, u, 1e-3)])
    found = fit(STAGE, [Record(u, 1.02 * y, 1e-3)], ["bouc_wen.p1", "bouc_wen.p2"], damping=1e6)
    assert found.converged
    assert found.iterations == 1 + STALLED
