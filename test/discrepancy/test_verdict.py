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

"""What a name asks for."""

import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from piezo_hysteresis.discrepancy.diagnosis import Diagnosis
from piezo_hysteresis.discrepancy.gap import Gap, PhaseGap
from piezo_hysteresis.discrepancy.search.candidates import FittedCandidate
from piezo_hysteresis.discrepancy.search.selection_result import Selection, Step
from piezo_hysteresis.discrepancy.verdict import Conclusion, is_explained, named_conclusion, unnamed_conclusion
from piezo_hysteresis.effects import AmplifierSaturation, Arx, BoucWen, Creep, MainsHum
from piezo_hysteresis.effects.extent import Extent
from piezo_hysteresis.identification.fit.cross_validation import Score
from piezo_hysteresis.identification.fit.fit import Fit
from piezo_hysteresis.identification.records.noise_floor import ADEQUATE
from piezo_hysteresis.identification.training.training_data import TrainingData
from piezo_hysteresis.model.model import Model
from piezo_hysteresis.record import Experiment, Record
from piezo_hysteresis.report.tables.answer_tables import effect_table

STAGE = Model((BoucWen(), Arx(b=(1.0,))), 1e-4, 10.0, 1e-5)
RECORD = Record(np.linspace(0.0, 10.0, 100), np.zeros(100), 1e-4)
EVIDENCE = TrainingData((RECORD,), np.ones(1), Extent.of([RECORD], STAGE.voltage_scale, STAGE.displacement_scale))


def selection(explained, leaves):
    """A search that found creep, which explains a share of the gap and leaves so many V."""
    before, after = (
        Score(np.full(10, np.sqrt(v)), np.zeros(1)) for v in (1.0 + (leaves - 1.0) / (1.0 - explained) ** 2, leaves)
    )
    fitted = Fit(STAGE.with_effect(Creep()), (), np.empty((0, 0)), leaves, (), (), (), True, 1)
    step = Step(before, FittedCandidate(Creep(), EVIDENCE, after, fitted), True, (), {})
    return Selection(STAGE, STAGE, after, (step,), 1.0)


@pytest.mark.parametrize(
    ("explained", "leaves", "enough"),
    [(0.65, 2.0, True), (0.55, 2.0, False), (0.65, 100.0, False), (0.8, 100.0, True), (0.5, 1.4, True)],
)
def test_an_effect_that_leaves_a_large_gap_must_explain_more(explained, leaves, enough):
    assert is_explained(selection(explained, leaves)) is enough


@given(st.floats(0.0, 0.99), st.floats(1.1, 1e4), st.floats(0.0, 0.99), st.floats(1.1, 1e4))
def test_explaining_more_and_leaving_less_is_never_worse(first, leaves, second, leaves_second):
    better, worse = selection(second, leaves_second), selection(first, leaves)
    something_is_missing = better.steps[0].before.excess > ADEQUATE
    if first <= second and leaves >= leaves_second and something_is_missing:
        assert is_explained(worse) <= is_explained(better)


def test_nothing_added_explains_nothing():
    score = Score(np.full(10, 5.0), np.zeros(1))
    assert not is_explained(Selection(STAGE, STAGE, score, (), 1.0))


def test_intervals_beside_a_visible_error_are_said_to_hold_for_the_law_only():
    """The test records alone were at the floor, and the law had another exponent than its interval said."""
    gap = Gap(1.0, 0.1, 0.1, None, (PhaseGap("triangle", 0, 1.0, 0.1, 0.1),), True, 0.1)
    for leaves, is_told in ((3.65, True), (1.2, False)):
        _, said = named_conclusion(selection(0.9, leaves), gap)
        assert ("keep an error of 1.9 floors" in said and "for this law only" in said) is is_told


def with_hum(first, share):
    """The search that found hum beside creep, so that both explain a share of the gap."""
    (step,) = first.steps
    after = Score(np.sqrt(1.0 + (1.0 - share) ** 2 * (step.before.ratios**2 - 1.0)), np.zeros(1))
    model = step.best.fit.model.with_effect(MainsHum())
    hum = FittedCandidate(MainsHum(), EVIDENCE, after, replace(step.best.fit, model=model))
    return replace(first, model=model, score=after, steps=(step, Step(step.best.score, hum, True, (), {})))


def test_no_effect_of_several_is_said_to_explain_nothing():
    """Creep alone does not lower the error, and with hum nothing is left: its share was stated as 0 %."""
    found = with_hum(selection(0.0, 50.0), 1.0)
    row = PhaseGap("triangle", 0, 0.7, 0.1, 0.1)
    gap = Gap(0.7, 0.1, 0.1, None, (row,), True, 0.1)
    fit = found.steps[-1].best.fit
    said, experiment = named_conclusion(found, gap), Experiment((RECORD,))
    diagnosis = Diagnosis(*said, fit.model, STAGE, experiment, found, fit, gap=gap)
    assert [row["explained_fraction"] for row in diagnosis.effects()] == [1.0, 1.0]
    assert "explain 100 % of the gap" in diagnosis.reason
    for text in (diagnosis.summary(), repr(effect_table(diagnosis.answer())), diagnosis._repr_html_()):
        assert "100 %" in text and not re.search(r"\b0 %", text)


def test_a_limit_that_is_never_reached_has_no_interval():
    """Without influence its variance is 0, which was stated as an interval from -1e9 to -1e9 V."""
    limit, first = AmplifierSaturation(upper=8.7), selection(0.9, 1.0)
    names = tuple(f"amplifier_saturation.{n}" for n in ("lower", "upper"))
    fit = Fit(STAGE.with_effect(limit), names, np.diag([0.0, 1e-4]), 1.0, (), (), (), True, 1)
    (step,) = first.steps
    found = replace(first, steps=(replace(step, best=replace(step.best, effect=limit, fit=fit)),))
    gap = Gap(1.0, 0.1, 0.1, None, (PhaseGap("triangle", 0, 1.0, 0.1, 0.1),), True, 0.1)
    diagnosis = Diagnosis(Conclusion.MISSING_EFFECT, "", fit.model, STAGE, Experiment((RECORD,)), found, fit, gap=gap)
    (effect,) = diagnosis.effects()
    assert effect["parameters"]["lower"]["interval_95"] is None
    assert effect["parameters"]["upper"]["interval_95"] == pytest.approx([8.7 - 0.0196, 8.7 + 0.0196])
    assert "-1e+09 V (not determined)" in diagnosis.summary()


def test_nothing_is_missing_at_the_floor_although_an_effect_explains_a_small_part_of_the_error():
    gap = Gap(0.11, 0.11, 0.1, None, (PhaseGap("triangle", 0, 0.11, 0.11, 0.1),), True, 0.11)
    for first, expected in ((1.4, Conclusion.NOTHING_MISSING), (1.8, Conclusion.UNEXPLAINED_GAP)):
        found = selection(0.4, 1.0 + (first - 1.0) * 0.6**2)
        assert found.steps[0].before.excess == pytest.approx(first)
        assert unnamed_conclusion(found, True, gap)[0] is expected


def test_the_closest_answer_is_all_that_was_added():
    """Of two effects that explain 50 % together, only the first was stated, with its 40 %."""
    second = with_hum(selection(0.4, 50.0), 0.5)
    gap = Gap(1.0, 1.0, 0.1, None, (), True, 1.0)
    conclusion, reason = unnamed_conclusion(second, True, gap)
    assert conclusion is Conclusion.UNEXPLAINED_GAP
    assert "the closest effect is creep with mains_hum, which explains 50 % of the gap" in reason
