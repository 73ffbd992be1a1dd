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

"""The score test of the catalogue: which start values it tries."""

from dataclasses import replace

import numpy as np
import pytest

from piezo_hysteresis.discrepancy.search.candidates import screen
from piezo_hysteresis.effects import (
    HYSTERESIS,
    AmplifierSlewLimit,
    Arx,
    Backlash,
    Offset,
    RateDependentHysteresis,
    Softening,
)
from piezo_hysteresis.effects.extent import Extent
from piezo_hysteresis.identification.training.training_data import TrainingData
from piezo_hysteresis.model.model import Model
from piezo_hysteresis.record import Record

PERIOD, NOISE = 1e-4, 1e-9
STAGE = Model(
    (HYSTERESIS(A=-0.24, beta=4.9, gamma=-2.0, p2=1.0), Arx(a=(-1.6, 0.7), b=(0.1,)), Offset()), PERIOD, 10.0, 1e-5
)
TRIED = (AmplifierSlewLimit, Backlash, RateDependentHysteresis, Softening)


def starts_found(hidden, is_small):
    """The best start of every effect for a stage with a hidden one, best first."""
    rng, time = np.random.default_rng(0), PERIOD * np.arange(3000)
    drives = [5.0 * (1.0 - np.cos(2.0 * np.pi * f * time)) for f in (5.0, 10.0, 20.0)]
    records = [Record(u, np.zeros(u.size), PERIOD, initial_voltage=0.0) for u in drives]
    moved = zip(records, STAGE.with_effect(hidden).simulate(records), strict=True)
    records = [replace(r, displacement=y + NOISE * rng.normal(size=y.size)) for r, y in moved]
    data = TrainingData(tuple(records), np.full(3, NOISE), Extent.of(records, 10.0, 1e-5))
    found = screen(STAGE, data, TRIED, is_small)
    costs = [candidate.score.cost for candidate in found]
    assert costs == sorted(costs)
    assert len({candidate.name for candidate in found}) == len(found)
    return {candidate.name: candidate.effect for candidate in found}


@pytest.mark.parametrize("is_small", [False, True])
def test_where_little_is_left_a_term_of_the_dynamics_is_only_tried_near_zero(is_small):
    found = starts_found(Softening(k3=0.05), is_small)
    assert next(iter(found)) == Softening.name
    assert found[Softening.name].is_off is is_small


@pytest.mark.parametrize("is_small", [False, True])
def test_an_effect_of_the_drive_which_the_dynamics_can_hide_is_always_tried_at_every_size(is_small):
    found = starts_found(Backlash(b=0.05), is_small)
    assert next(iter(found)) == Backlash.name
    assert not found[Backlash.name].is_off
