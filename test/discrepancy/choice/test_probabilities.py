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

"""Probabilities of the explanations, and the next drive."""

import math
from types import SimpleNamespace
from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from piezo_hysteresis.discrepancy.choice.probabilities import (
    NONE_OF_THESE,
    NOTHING,
    log_odds,
    probabilities,
    scatter_odds,
    step_probabilities,
)
from piezo_hysteresis.discrepancy.choice.tiers import spare_drives, tiers
from piezo_hysteresis.discrepancy.choice.time_to_decide import (
    ERROR_RATE,
    ONE_RECORD,
    best_drive,
    expected_log_odds,
    missing_log_odds,
    z_of,
)
from piezo_hysteresis.discrepancy.search.candidates import Candidate, FittedCandidate
from piezo_hysteresis.discrepancy.search.selection_result import Selection, Step
from piezo_hysteresis.discrepancy.verdict import Verdict
from piezo_hysteresis.effects import Arx, Backlash, BoucWen, Creep, MainsHum, ThermalDrift
from piezo_hysteresis.effects.extent import Extent
from piezo_hysteresis.identification.fit.cross_validation import Score
from piezo_hysteresis.identification.fit.fit import Fit
from piezo_hysteresis.identification.protocol.drive_limits import DriveLimits
from piezo_hysteresis.identification.training.training_data import TrainingData
from piezo_hysteresis.model.model import Model
from piezo_hysteresis.record import Record

LIMITS = DriveLimits(1e-3)
STAGE = Model((BoucWen(), Arx(b=(1.0,))), 1e-3, 10.0, 1e-5)
RECORDS = tuple(
    Record(p.voltage, np.zeros(p.voltage.size), 1e-3, p.name) for p in tiers(LIMITS)[0].phases if p.name != "rest"
)
DATA = TrainingData(
    RECORDS, np.full(len(RECORDS), 5e-9), Extent.of(RECORDS, STAGE.voltage_scale, STAGE.displacement_scale)
)
PRIOR = {
    NOTHING: 0.4,
    NONE_OF_THESE: 0.1,
    "creep": 0.125,
    "thermal_drift": 0.125,
    "backlash": 0.125,
    "mains_hum": 0.125,
}
RATIOS = st.lists(st.floats(0.1, 1e3), min_size=6, max_size=6)


def score(ratios):
    return Score(np.asarray(ratios, dtype=float), np.zeros(1))


def turn(before, *tried):
    """A turn of the search in which effects were tried, each with its errors of the records."""
    candidates = [Candidate(effect(), DATA, score(ratios)) for effect, ratios in tried]
    best = min(candidates, key=lambda c: c.score.cost)
    fitted = FittedCandidate(best.effect, DATA, best.score, Fit(STAGE, (), np.empty((0, 0)), 1.0, (), (), (), True, 1))
    return Step(score(before), fitted, True, (), {}, (fitted, *(c for c in candidates if c is not best)))


@given(RATIOS, RATIOS, RATIOS, RATIOS)
def test_probabilities_sum_to_one_and_none_is_negative(before, first, second, third):
    told = step_probabilities(turn(before, (Creep, first), (ThermalDrift, second), (MainsHum, third)), PRIOR, 1.0)
    assert math.isclose(sum(told.values()), 1.0, rel_tol=1e-12)
    assert all(p >= 0.0 for p in told.values())
    assert set(told) == set(PRIOR) - {"backlash"}


@given(RATIOS, RATIOS)
def test_equal_evidence_leaves_the_prior(before, ratios):
    told = step_probabilities(turn(before, (Creep, ratios), (ThermalDrift, ratios)), PRIOR, 1.0)
    assert told["creep"] == pytest.approx(told["thermal_drift"])


@given(st.integers(1, 20), st.integers(0, 19), st.floats(10.0, 1e6))
def test_no_record_decides_alone(count, index, ratio):
    other = np.ones(count)
    other[index % count] = ratio
    needed = missing_log_odds({"creep": 0.5, "thermal_drift": 0.5}, ERROR_RATE)
    assert log_odds(score(np.ones(count)), score(other)) <= ONE_RECORD < needed


def test_before_any_evidence_nothing_has_most_and_all_effects_share_a_half():
    unsearched = SimpleNamespace(selection=None)
    told = probabilities(unsearched, {"creep", "thermal_drift", "backlash", "mains_hum"})
    assert told == pytest.approx(PRIOR)


def test_an_error_below_the_floor_is_not_evidence():
    assert log_odds(score([0.1] * 8), score([0.9] * 8)) == 0.0


def test_an_effect_that_explains_too_little_is_less_likely_than_none_of_these():
    told = step_probabilities(turn([10.0] * 8, (Creep, [7.0] * 8), (Backlash, [8.0] * 8)), PRIOR, 1.0)
    assert next(iter(told)) == NONE_OF_THESE


class Found(NamedTuple):
    """What the probabilities read of a diagnosis."""

    selection: Selection
    verdict: Verdict


def two_steps(after):
    """Creep explains half of the gap, and backlash what then remains, down to `after`; either may come first."""
    first = turn([10.0] * 8, (Creep, [5.0] * 8), (Backlash, [5.2] * 8), (MainsHum, [9.0] * 8))
    steps = (first, turn([5.0] * 8, (Backlash, [after] * 8), (MainsHum, [4.9] * 8)))
    return Found(Selection(STAGE, STAGE, steps[-1].best.score, steps, 1.0), Verdict.NAMED)


def test_two_effects_that_leave_the_noise_are_likelier_than_none_of_these():
    told = probabilities(two_steps(1.0), set(PRIOR) - {NOTHING, NONE_OF_THESE})
    assert next(iter(told)) == "creep + backlash"
    assert told["creep + backlash"] > 0.99
    assert sum(told.values()) == pytest.approx(1.0)


def test_what_is_missing_beside_a_named_effect_does_not_deny_the_effect():
    told = probabilities(two_steps(2.0), set(PRIOR) - {NOTHING, NONE_OF_THESE})
    assert next(iter(told)) == "creep + none of these"


def test_a_lead_that_changes_its_sign_between_records_is_chance():
    assert scatter_odds(score([1, 2, 1, 2, 1, 2]), score([2, 1, 2, 1, 2, 1])) < 1.0
    assert scatter_odds(score([1.0, 1.1, 1.2, 1.1]), score([3.0, 3.1, 3.4, 3.2])) > missing_log_odds(
        {"a": 0.5, "b": 0.5}, 0.005
    )


@given(st.floats(0.0, 1e9), st.floats(0.1, 1e3), st.sampled_from((1, 2, 4, 8)))
def test_expected_evidence_grows_with_distance_and_repeats_and_falls_with_misfit(distance, excess, repeats):
    told = expected_log_odds(distance, excess, repeats)
    assert 0.0 <= told <= repeats * ONE_RECORD
    assert expected_log_odds(2.0 * distance, excess, repeats) >= told
    assert expected_log_odds(distance, 2.0 * excess, repeats) <= told
    assert expected_log_odds(distance, excess, 2 * repeats) == pytest.approx(2.0 * told)


def fitted(*effects):
    """Rivals with the same score."""
    made = []
    for effect in effects:
        model = STAGE.with_effect(effect)
        fit = Fit(model, (), np.empty((0, 0)), 1.0, (), (), (), True, 1)
        made.append(FittedCandidate(effect, DATA, score([1.0] * len(RECORDS)), fit))
    return made


def test_the_chosen_drive_separates_creep_from_drift_in_the_least_time():
    drives = [p for p in spare_drives(LIMITS) if p.name in ("staircase", "noise", "rest")]
    rivals = fitted(Creep(gamma=0.02), ThermalDrift(D=3e-7, tau=60.0))
    phases, separation = best_drive(rivals, drives, missing=5.3, time_left=600.0)
    assert separation.decides
    assert {*separation.rivals} == {"creep", "thermal_drift"}
    assert separation.duration == pytest.approx(sum(p.duration for p in phases))
    assert separation.needed_z == z_of(5.3)


def test_equal_rivals_have_zero_expected_separation():
    first, second = fitted(Creep(gamma=0.02), Creep(gamma=0.02))
    _, separation = best_drive([first, second], spare_drives(LIMITS)[-2:], missing=5.3, time_left=600.0)
    assert not separation.decides
    assert separation.expected_z == pytest.approx(0.0, abs=1e-3)
    assert "by 0.0 standard deviations, and 3.3 are needed" in separation.sentence()


def test_no_drive_is_chosen_that_does_not_fit_into_the_time():
    rivals = fitted(Creep(gamma=0.02), ThermalDrift(D=3e-7, tau=60.0))
    assert best_drive(rivals, spare_drives(LIMITS), missing=5.3, time_left=0.1) is None
