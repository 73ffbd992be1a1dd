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

"""A drive that is not held between its samples: the step in the first sample and the sines have different lags."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.nanopositioner import Nanopositioner, growing_sine
from benchmarks.rates import PERIOD
from piezo_hysteresis.identification.fit.normal_equations import Nuisance
from piezo_hysteresis.identification.free_run_error import errors
from piezo_hysteresis.identification.identify import identify
from piezo_hysteresis.record import Experiment, Record

FINER = 8
HOLD = 1.0


def played(stage: Nanopositioner, frequency: float) -> tuple[Record, Record]:
    """A step with the first sample, then sines, from a generator that does not hold its output."""
    drive = growing_sine(frequency, PERIOD / FINER, (0.3, 0.6, 1.0), hold=HOLD)
    fine = stage.play(drive, PERIOD / FINER)
    record = Record(fine.voltage[::FINER], fine.displacement[::FINER], PERIOD, initial_voltage=0.0)
    step, sine = record.split(round(HOLD / PERIOD))
    return replace(step, phase="step"), replace(sine, phase=f"sine_{frequency:g}hz")


@pytest.mark.parametrize("seed", [pytest.param(1, marks=pytest.mark.soak), 2])
def test_a_step_at_another_time_than_its_sample_does_not_disturb_the_sines(seed):
    """The lag was a compromise between both, with errors of 0.5 % at 30 Hz."""
    rng = np.random.default_rng(seed)
    stage = Nanopositioner.random(rng, mode=650.0, zeta=0.026, delay=3.5e-4, pole=7e-5)
    found = identify(Experiment(tuple(r for f in (1.0, 10.0, 60.0) for r in played(stage, f))), memory=True)
    assert "step_time" in {notice.kind for notice in found.notices}
    rows = errors(found.model, Experiment(played(stage, 30.0)), Nuisance(offset=True)).rows
    assert rows[1].percent < 0.2
    assert found.model["extra_resonance"]["f0"] == pytest.approx(stage.mode, rel=0.02)
