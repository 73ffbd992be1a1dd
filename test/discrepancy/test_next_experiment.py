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

"""The drive that separates two models."""

import numpy as np
import pytest

from piezo_hysteresis.discrepancy.next_experiment import distances
from piezo_hysteresis.discrepancy.search.training_data import TrainingData
from piezo_hysteresis.effects import Arx, BoucWen, Offset, SensorNonlinearity, Softening
from piezo_hysteresis.effects.extent import Extent
from piezo_hysteresis.errors import DivergenceError
from piezo_hysteresis.identification.fit.normal_equations import Nuisance
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
    training_data = TrainingData(records, np.array([1e-9]), Nuisance(), extent)
    found = distances(first, second, training_data, {"gentle": gentle, "violent": violent})
    assert found["gentle"] > 0.0
    assert found["violent"] == 0.0
