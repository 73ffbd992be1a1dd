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

"""A step whose response the model cannot follow does not determine the rest of the model."""

import numpy as np
import pytest

from benchmarks.nanopositioner import Nanopositioner, growing_sine
from piezo_hysteresis.identification.identify import identify
from piezo_hysteresis.record import Experiment

PERIOD = 5e-3


@pytest.mark.parametrize("mode", [395.0, 590.0], ids=["two", "three"])
def test_a_mode_above_half_the_sampling_rate_does_not_change_loop_and_creep(mode):
    """Near a multiple of the sampling rate it looks like a slow decay, which lag, loop and creep took up."""
    stage = Nanopositioner(mode=mode, zeta=0.03, pole=1e-4, delay=6e-3)
    drive = growing_sine(1.0, PERIOD, (1.0,), cycles=6)
    model = identify(Experiment((stage.play(drive, PERIOD),)), memory=True).model
    other = stage.play(growing_sine(1.0, PERIOD, (0.3, 0.6, 1.0)), PERIOD)
    error = (other.displacement - model.simulate(other)[0])[100:]  # behind the step
    assert np.std(error) < 3e-3 * np.ptp(other.displacement)
    creep = model.values()
    assert creep.get("creep.gamma", creep.get("creep_two_rates.gamma_slow")) > 0.002
