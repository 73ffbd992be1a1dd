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

"""The drive that separates two models, and the one that is proposed after a diagnosis."""

from dataclasses import replace

import numpy as np
import pytest

from piezo_hysteresis.discrepancy.choice.next_experiment import best_next_experiment, possible_drives
from piezo_hysteresis.discrepancy.choice.time_to_decide import distances
from piezo_hysteresis.discrepancy.search.candidates import FittedCandidate
from piezo_hysteresis.discrepancy.search.selection_result import Selection, Step
from piezo_hysteresis.effects import Arx, BoucWen, Creep, Offset, SensorNonlinearity, Softening, ThermalDrift
from piezo_hysteresis.effects.extent import Extent
from piezo_hysteresis.errors import DivergenceError
from piezo_hysteresis.identification.fit.cross_validation import Score
from piezo_hysteresis.identification.fit.fit import Fit
from piezo_hysteresis.identification.training.training_data import TrainingData
from piezo_hysteresis.model.model import Model
from piezo_hysteresis.record import Record

PERIOD = 1e-4
RADIUS, ANGLE = 0.98, 0.3
"""Pole of a lightly damped mode."""
A = (-2.0 * RADIUS * np.cos(ANGLE), RADIUS**2)
MODEL = Model((BoucWen(A=0.0, p1=0.0, p2=1.0), Arx(a=A, b=(1.0 + sum(A),), delay=1), Offset()), PERIOD, 1.0, 1e-5)


def drive(amplitude, jumps):
    t = PERIOD * np.arange(2000)
    u = amplitude * (np.sign(np.sin(60.0 * t)) if jumps else np.sin(60.0 * t))
    return Record(u, np.zeros(u.size), PERIOD, initial_voltage=0.0)


def test_a_drive_with_which_a_model_diverges_separates_nothing():
    first, second = MODEL.with_effect(Softening(k3=-0.4)), MODEL.with_effect(SensorNonlinearity(s3=0.01))
    gentle, violent = drive(0.3, False), drive(1.0, True)
    with pytest.raises(DivergenceError):
        first.simulate(violent)
    records = (gentle.with_channels(lambda x: x, displacement=MODEL.simulate(gentle)[0]),)
    extent = Extent.of(records, MODEL.voltage_scale, MODEL.displacement_scale)
    training_data = TrainingData(records, np.array([1e-9]), extent)
    found = distances(first, second, training_data, {"gentle": gentle, "violent": violent})
    assert found["gentle"] > 0.0
    assert found["violent"] == 0.0


def rivals(period, *effects):
    """A selection in which the data cannot distinguish two effects, from a record between 1 and 4 V."""
    stage = Model((BoucWen(), Arx(b=(1.0,))), period, 10.0, 1e-5)
    u = 2.5 + 1.5 * np.sin(2.0 * np.pi * period / 0.5 * np.arange(round(2.0 / period)))
    records = (Record(u, np.zeros(u.size), period, initial_voltage=2.5),)
    data = TrainingData(records, np.array([5e-9]), Extent.of(records, 10.0, 1e-5))
    same = Score(np.ones(1), np.zeros(1))
    fitted = []
    for effect in effects:
        fit = Fit(stage.with_effect(effect), (), np.empty((0, 0)), 1.0, (), (), (), True, 1)
        fitted.append(FittedCandidate(effect, data, same, fit))
    step = Step(Score(np.full(1, 9.0), np.zeros(1)), fitted[0], True, tuple(fitted[1:]), {})
    return Selection(stage, fitted[0].fit.model, same, (step,), 1.0), data


@pytest.mark.parametrize("period", [1e-3, 2e-2])
def test_the_proposed_drive_separates_the_rivals_inside_the_recorded_range(period):
    selection, data = rivals(period, Creep(gamma=0.02), ThermalDrift(D=3e-7, tau=60.0))
    found = best_next_experiment(selection, data)
    assert found.decides
    assert {*found.rivals} == {"creep", "thermal_drift"}
    assert found.drive in {d.name for d in possible_drives(data)}
    recorded = data.records[0].voltage
    steepest = np.abs(np.diff(recorded)).max() / period
    for drive in possible_drives(data):
        assert recorded.min() <= drive.voltage.min() <= drive.voltage.max() <= recorded.max()
        assert drive.largest_slew <= steepest * (1 + 1e-6)


def test_equal_rivals_are_told_that_no_drive_decides():
    selection, data = rivals(1e-3, Creep(gamma=0.02), Creep(gamma=0.02))
    assert best_next_experiment(selection, data) is None
    selection, data = rivals(1e-3, Creep(gamma=0.0), ThermalDrift(D=0.0, tau=60.0))
    found = best_next_experiment(selection, data)
    assert not found.decides
    assert found.expected_z == pytest.approx(0.0, abs=1e-3)


def test_a_jump_in_the_first_sample_is_a_recorded_slew_rate():
    held = Record(np.full(100, 4.0), np.zeros(100), 1e-3, initial_voltage=1.0)
    extent = replace(Extent.of((held,), 10.0, 1e-5), voltage_min=1.0, voltage_max=4.0)
    drives = possible_drives(TrainingData((held,), np.array([5e-9]), extent))
    assert max(d.largest_slew for d in drives) <= 3.0 / 1e-3 * (1 + 1e-6)


@pytest.mark.parametrize("period", [0.2, 0.3, 0.5, 1.0])
def test_drives_at_long_sample_periods_are_those_that_the_rate_allows(period):
    """Noise of a second has too few samples there, as a sine of 1 Hz does."""
    u = np.concatenate([np.linspace(0.0, 10.0, 100), np.linspace(10.0, 0.0, 100)])
    slow = Record(u, np.zeros(u.size), period)
    drives = possible_drives(TrainingData((slow,), np.ones(1), Extent.of((slow,), 10.0, 1e-5)))
    assert {"staircase", "rest"} <= {d.name for d in drives}
