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

"""A drive that is not held between its samples: the step and the sines have different lags."""

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


def played(stage: Nanopositioner, frequency: float, first: int) -> tuple[Record, Record]:
    """A step, then sines, from a generator that does not hold its output.

    The first sample is `first` fine samples after the step. The sines come half a sample earlier than if their output
    were held, and the step `first` / `FINER` samples earlier.
    """
    drive = growing_sine(frequency, PERIOD / FINER, (0.3, 0.6, 1.0), hold=HOLD)
    fine = stage.play(drive, PERIOD / FINER)
    record = Record(fine.voltage[first::FINER], fine.displacement[first::FINER], PERIOD, initial_voltage=0.0)
    step, sine = record.split(round(HOLD / PERIOD))
    return replace(step, phase="step"), replace(sine, phase=f"sine_{frequency:g}hz")


@pytest.mark.parametrize("seed", [pytest.param(1, marks=pytest.mark.soak), 2])
@pytest.mark.parametrize(("first", "kind"), [(0, "step_edge"), pytest.param(7, "step_time", marks=pytest.mark.soak)])
def test_a_step_at_another_time_than_its_sample_does_not_disturb_the_sines(seed, first, kind):
    """The lag was a compromise between both, with errors of 0.5 % at 30 Hz."""
    rng = np.random.default_rng(seed)
    stage = Nanopositioner.random(rng, mode=650.0, zeta=0.026, delay=3.5e-4, pole=7e-5)
    parts = (r for f in (1.0, 10.0, 60.0) for r in played(stage, f, first))
    found = identify(Experiment(tuple(parts)), memory=True)
    assert {n.kind for n in found.notices} & {"step_edge", "step_time"} == {kind}
    rows = errors(found.model, Experiment(played(stage, 30.0, first)), Nuisance(offset=True)).rows
    assert rows[1].percent < 0.2
    if kind == "step_edge":  # a later step is like one of an amplifier with a largest slope
        assert rows[0].percent < 0.1
    assert found.model["extra_resonance"]["f0"] == pytest.approx(stage.mode, rel=0.02)
