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

"""What counts as an effect once it has been fitted."""

import numpy as np
import pytest

from piezo_hysteresis.discrepancy.search.acceptance_tests import Trial, bends_all_along, first_rejection, may_be_off
from piezo_hysteresis.discrepancy.search.candidates import FittedCandidate
from piezo_hysteresis.discrepancy.search.cross_validation import Score
from piezo_hysteresis.discrepancy.search.refit import Fitted
from piezo_hysteresis.discrepancy.search.training_data import TrainingData
from piezo_hysteresis.effects import AmplifierSaturation, BoucWen, GainDrift, HysteresisMemory
from piezo_hysteresis.effects.extent import Extent
from piezo_hysteresis.identification.fit.fit import Fit
from piezo_hysteresis.identification.fit.normal_equations import Nuisance
from piezo_hysteresis.model.model import Model

EXTENT = Extent(0.0, 10.0, 1e3, 10.0, 1e-5, 2e-5, 100.0, 10.0, 10.0)


def fitted(effect, names, covariance):
    model = Model((BoucWen(A=0.5, beta=3.0, gamma=0.5, p1=0.0, p2=1.0), effect), 2e-5, 10.0, 1e-5)
    result = Fit(model, names, np.asarray(covariance), 1.0, (), (), (), True, 3)
    training_data = TrainingData((), np.array([]), Nuisance(), EXTENT)
    return FittedCandidate(effect, training_data, Score(np.ones(3), np.zeros(len(names))), result)


def gain_drift(size, along, across):
    """Size and time constant so correlated that only their ratio is known well, as where the end is never seen."""
    tau = 600.0
    direction = np.array([size / tau, 1.0])
    normal = np.array([1.0, -size / tau])
    covariance = along**2 * np.outer(direction, direction) + across**2 * np.outer(normal, normal)
    return fitted(GainDrift(g=size, tau=tau), ("gain_drift.g", "gain_drift.tau"), covariance)


def test_a_size_correlated_with_its_time_constant_is_significant():
    blurred = gain_drift(0.05, along=1000.0, across=1e-3)
    assert blurred.fit.standard_errors["gain_drift.g"] > 0.05
    assert not may_be_off(blurred)


def test_a_size_below_its_error_may_be_off():
    assert may_be_off(gain_drift(0.05, along=1.0, across=0.1))


@pytest.mark.parametrize(("corner", "curve"), [(0.1, False), (4.0, False), (30.0, True)])
def test_a_limit_whose_bend_is_wider_than_the_drive_is_rejected(corner, curve):
    saturation = AmplifierSaturation(upper=9.0, corner=corner)
    assert bends_all_along(fitted(saturation, (), np.empty((0, 0)))) is curve


@pytest.mark.parametrize("blind", [1e6, 1e145])
def test_a_play_that_does_not_move_has_no_influence(blind):
    memory = HysteresisMemory(c=(0.02, 0.03, 0.0))
    names = tuple(f"hysteresis_memory.c[{j}]" for j in range(3))
    assert not may_be_off(fitted(memory, names, np.diag([1e-3, 1e-3, blind]) ** 2))
    assert may_be_off(fitted(memory, names, np.diag([0.1, 0.1, blind]) ** 2))


def test_the_first_acceptance_test_that_rejects_gives_the_reason():
    """Both the model without the effect and Wald's test object here: the first is the one that is reported."""
    weak = gain_drift(0.05, along=1.0, across=0.1)
    alone = Fitted(weak.fit.model, weak.score)
    rejection = first_rejection(Trial(weak, alone, 1.0, 0.8))
    assert rejection.name == "gain_drift"
    assert "refitted without it" in rejection.reason
    assert first_rejection(Trial(weak, None, 1.0, 0.8)).reason.startswith("its parameters do not differ")
