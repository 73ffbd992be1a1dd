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

"""Stages of another form that were driven up and back before the records, which no record shows."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.naming_experiments import ladder
from benchmarks.other_forms import KINDS, random_stage
from piezo_hysteresis.effects import CATALOGUE, HYSTERESIS, MEMORY
from piezo_hysteresis.identification.identify import identify
from piezo_hysteresis.identification.structure.state_at_rest import without_hidden_start
from piezo_hysteresis.record import Experiment, Record

PERIOD = 1e-3
LOOP = ladder((0.0, 10.0, 0.0), 0.5, 20.0, PERIOD)
"""A loop over the whole range, and a rest."""
STILL = np.zeros(LOOP.size)
DRIVES = [
    ladder((0.0, 10.0, 0.0, 10.0, 0.0, 6.0, 0.0, 6.0, 0.0, 3.0, 0.0), 0.05, 20.0, PERIOD),
    np.repeat((0.0, 8.0, 3.0, 10.0, 0.0), 400),
    ladder((0.0, *(10.0, 0.0) * 4), 0.05, 200.0, PERIOD),
]
OTHERS = [
    ladder((0.0, 7.0, 5.0, 6.5, 2.0, 4.0, 0.0), 0.05, 10.0, PERIOD),
    np.concatenate((np.zeros(100), 4.5 - 4.5 * np.cos(2.0 * np.pi * 5.0 * PERIOD * np.arange(1000)))),
]


def measured(kind, before, drives):
    """Records of a stage, each after the drive `before`, which is not part of it."""
    stage = random_stage(KINDS[kind], 0)
    return [
        Record(u, stage.play(np.concatenate((before, u)), PERIOD).displacement[before.size :], PERIOD) for u in drives
    ]


def percent(model, records):
    """Errors with a free constant [% of the range]."""
    span = max(np.ptp(r.displacement) for r in records)
    return [100.0 * np.std(r.displacement - y) / span for r, y in zip(records, model.free_run(records), strict=True)]


@pytest.mark.parametrize(
    ("kind", "before", "largest"),
    [
        ("relays", LOOP, 0.3),
        pytest.param("relays", STILL, 0.3, marks=pytest.mark.soak),
        pytest.param("generalised plays", LOOP, 0.2, marks=pytest.mark.soak),
        pytest.param("relays", 0.6 * LOOP, 0.4, marks=pytest.mark.soak),
        ("generalised plays", STILL, 0.3),
        pytest.param("Coleman-Hodgdon", LOOP, 0.4, marks=pytest.mark.soak),
    ],
)
def test_other_drives_are_predicted_whatever_was_driven_before(kind, before, largest):
    found = identify(Experiment(tuple(measured(kind, before, DRIVES))), memory=True)
    assert max(percent(found.model, measured(kind, before, OTHERS))) < largest
    was_driven = bool(before.any())
    assert any(n.kind == "state_at_rest" for n in found.notices) == was_driven
    if MEMORY.name in found.model:
        assert (found.model[MEMORY.name].array("turns").size > 0) == was_driven
    else:
        assert (HYSTERESIS.start_term.name in found.model) == was_driven


@pytest.mark.parametrize(
    ("kind", "before", "largest"),
    [
        ("relays", LOOP, 0.4),
        pytest.param("generalised plays", LOOP, 0.4, marks=pytest.mark.soak),
        pytest.param("Bouc-Wen, n = 1.6", LOOP, 0.4, marks=pytest.mark.soak),
        pytest.param("Coleman-Hodgdon", LOOP, 0.4, marks=pytest.mark.soak),
        pytest.param("Coleman-Hodgdon", STILL, 0.6, marks=pytest.mark.soak),
    ],
)
def test_conditioning_shows_what_was_driven_before_it(kind, before, largest):
    """No record that is fitted depends on it: all of them continue the conditioning."""
    conditioning = ladder((0.0, 10.0, 0.0, 10.0, 0.0), 0.05, 20.0, PERIOD)
    (whole,) = measured(kind, before, [np.concatenate((conditioning, *DRIVES))])
    first, *later = whole.split(*np.cumsum([conditioning.size, *(u.size for u in DRIVES[:-1])]).tolist())
    found = identify(Experiment((replace(first, phase="conditioning"), *later)), memory=True)
    assert any(n.kind == "state_at_rest" for n in found.notices) == bool(before.any())
    assert max(percent(found.model, measured(kind, before, [conditioning, *OTHERS]))) < largest


def test_the_state_at_rest_is_no_candidate_where_every_run_begins_with_conditioning():
    """It was named instead of a saturation, which changes the peak of the conditioning: h0 = −1, at its bound."""
    conditioning, triangle = (Record(LOOP, LOOP, PERIOD, phase) for phase in ("conditioning", "triangle"))
    run = [conditioning, replace(triangle, continues=True)]
    assert {*CATALOGUE} - {*without_hidden_start(CATALOGUE, run)} == {HYSTERESIS.start_term}
    assert without_hidden_start(CATALOGUE, [*run, triangle]) == CATALOGUE
