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

"""A diagnosis that chooses its own phases and stops when it knows."""

from dataclasses import replace

import numpy as np
import pytest

from piezo_hysteresis.discrepancy.choice import live_diagnosis
from piezo_hysteresis.discrepancy.choice.live_diagnosis import begin
from piezo_hysteresis.discrepancy.choice.probabilities import NOTHING
from piezo_hysteresis.discrepancy.choice.tiers import FAST_TIERS
from piezo_hysteresis.discrepancy.choice.time_to_decide import Separation
from piezo_hysteresis.discrepancy.choice.update import End, Update
from piezo_hysteresis.effects import (
    AsymmetricHysteresis,
    Creep,
    ExtraDelay,
    SensorNonlinearity,
    Softening,
    ThermalDrift,
)
from piezo_hysteresis.errors import ParameterError
from piezo_hysteresis.identification.protocol.drive_limits import DriveLimits
from piezo_hysteresis.identification.protocol.phases import ProtocolPhase
from piezo_hysteresis.record import Experiment
from piezo_hysteresis.report.tables.probability_table import probability_table
from piezo_hysteresis.stage.plant import PlantParameters
from piezo_hysteresis.stage.simulated import SimulatedStage

PERIOD = 1e-4
"""Of drive and samples [s]."""
LIMITS = DriveLimits(PERIOD)
FEW = (AsymmetricHysteresis, Creep, ExtraDelay, SensorNonlinearity, Softening, ThermalDrift)
"""Effects to choose from where all others cost time only."""


def driven(hidden, limits=LIMITS, **choices):
    """A live diagnosis of a simulated stage, and every state of it."""
    stage = SimulatedStage(PlantParameters().with_values(hidden), seed=3, sample_period=PERIOD)
    states, records = [begin(limits, **choices)], []
    while states[-1].due:
        for p in states[-1].due:
            records.append(stage.play(p.voltage, p.name, continues=bool(records), average=p.stored_every))
        states.append(states[-1].advanced(Experiment(tuple(records))))
    return states


def holds_its_promises(states):
    """Whether the probabilities sum to one, and "sure" was said at the bound and not before."""
    for state in states[1:]:
        told = state.updates[-1].probabilities
        assert sum(told.values()) == pytest.approx(1.0)
        assert state.answer_is_sure == (state.end is End.SURE)
        if state.chosen:  # what it would take in the fixed order, and a tenth
            due = sum(p.duration for p in state.due)
            fixed = sum(tier.duration for tier in state.plan)
            assert state.time + due <= sum(tier.duration for tier in state.plan[: state.tier]) + 0.1 * fixed + 1e-9
    last = states[-1]
    if last.end is End.SURE:
        assert max(last.updates[-1].probabilities.values()) >= 1.0 - last.error_rate
    assert last.time == pytest.approx(sum(p.duration for s in states for p in s.due))
    assert last.time <= last.longest


def test_a_hidden_effect_is_named_after_the_cheap_phases():
    states = driven({"environment.hum": 2e-7})
    holds_its_promises(states)
    assert states[-1].end is End.SURE
    assert states[-1].found.names == ("mains_hum",)
    assert states[-1].time < 40.0


def test_nothing_missing_is_answered_when_no_slow_effect_can_show():
    states = driven({})
    holds_its_promises(states)
    assert states[-1].end is End.SURE
    assert states[-1].updates[-1].likeliest == NOTHING
    assert states[-1].untested == ()
    assert FAST_TIERS <= states[-1].tier < len(states[-1].plan)
    assert all(s.untested for s in states[1:-1])
    assert all(s.updates[-1].probabilities[NOTHING] < 1.0 - s.error_rate for s in states[1:-1])
    assert states[1].answer()["untested"] == ["creep", "gain_drift", "thermal_drift"]


def test_effects_that_no_drive_within_the_limits_separates_are_undecidable():
    """Slow drives make softening and a sensor nonlinearity the same, and the slew limit allows no others."""
    slow = DriveLimits(PERIOD, voltage_max=8.0, max_slew_rate=150.0)
    states = driven({"sensor.quadratic": 0.08}, slow, longest=40.0, effects=FEW)
    holds_its_promises(states)
    last = states[-1]
    assert last.end is End.UNDECIDABLE
    assert {*last.separation.rivals} == {"sensor_nonlinearity", "softening"}
    assert last.separation.expected_z < last.separation.needed_z
    assert last.answer()["undecidable"]["needed_z"] == last.separation.needed_z
    assert "No decision is possible within the limits and 40 s" in last.reason()
    (effect,) = last.found.effects()
    assert {effect["name"], *effect["confusable_with"]} == {*last.separation.rivals}


def test_terminal_page_and_node_state_the_same_probability_and_what_no_phase_could_show():
    """The table said 100.00 % beside > 99.9 %, and only the JSON file named the effects."""
    likely = Update(12.8, "loops", {"creep": 0.99999, "none of these": 0.00001})
    live = replace(begin(LIMITS), updates=(likely,), untested=("gain_drift", "thermal_drift"), end=End.SURE)
    table = probability_table(live.answer())
    assert "could not show gain drift and thermal drift" in table.note
    assert "creep is > 99.9 %" in table.note
    assert table.rows[0][2] == "> 99.9 %"


@pytest.mark.parametrize(("count", "most"), [(2, 4), (3, 4), (4, 0)])
def test_drives_are_chosen_for_two_or_three_rivals_and_end_if_they_do_not_decide(monkeypatch, count, most):
    """Chosen drives that decide by prediction and not by measurement would go on until the stage time is over."""
    drive = ProtocolPhase("noise", np.zeros(10), PERIOD)
    sure = Separation(("creep", "thermal_drift"), "noise", 1, drive.duration, 9.0, 3.0)
    monkeypatch.setattr(live_diagnosis, "rivals_of", lambda *_: [None] * count)
    monkeypatch.setattr(live_diagnosis, "best_drive", lambda *_: ((drive,), sure))
    live = begin(LIMITS)
    undecided = Update(80.0, "noise", {"creep": 0.5, "thermal_drift": 0.5})
    live = replace(live, tier=len(live.plan), updates=(undecided,), time=sum(t.duration for t in live.plan))
    chosen = 0
    while (live := live._decided()).due:
        chosen += 1
    assert chosen == most and live.end is End.EXHAUSTED


def test_without_more_stage_time_the_answer_is_not_certain():
    states = driven({}, longest=15.0)
    holds_its_promises(states)
    assert states[-1].end is End.EXHAUSTED
    assert "no explanation is certain" in states[-1].reason()


@pytest.mark.parametrize("choices", [{"error_rate": 0.0}, {"error_rate": 0.5}, {"longest": 5.0}])
def test_invalid_options_are_refused(choices):
    with pytest.raises(ParameterError):
        begin(DriveLimits(1e-3), **choices)
