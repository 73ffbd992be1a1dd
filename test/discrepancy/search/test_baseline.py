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

"""The baseline begins wherever there are loops, whatever the broadband records show."""

import numpy as np

from piezo_hysteresis.discrepancy.search.baseline import start_models
from piezo_hysteresis.effects import Arx, BoucWen
from piezo_hysteresis.identification.steps.linear_start import dynamics_of
from piezo_hysteresis.model.model import Model
from piezo_hysteresis.record import Record

PERIOD = 1e-4


def test_noise_that_does_not_determine_the_sign_of_the_gain_gives_a_start():
    stage = Model((BoucWen(), Arx(a=(), b=(1.0,), delay=2.0)), PERIOD, 10.0, 1e-5)
    time = PERIOD * np.arange(20_000)
    voltage = (1.0 + 4.0 * np.floor(time)) * (1.0 - np.abs(2.0 * np.mod(time, 1.0) - 1.0))
    loops = Record(voltage, stage.simulate(Record(voltage, time, PERIOD))[0], PERIOD, "triangle")
    noise = np.random.default_rng(0).normal(size=20_000)
    backwards = Record(5.0 + noise, -1e-6 * np.roll(noise, 2), PERIOD, "noise")
    for start in start_models((loops, backwards), (0, 1)):
        assert dynamics_of(start).dc_gain > 0.0
