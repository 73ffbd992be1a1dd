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

"""Whether a model describes new records of its stage, from records of every kind of drive."""

import numpy as np
import pytest

from piezo_hysteresis.changes.recalibration import recalibrate
from piezo_hysteresis.effects import BoucWen
from piezo_hysteresis.errors import IdentificationError
from piezo_hysteresis.identification.stage_check import check_stage
from piezo_hysteresis.model.model import Model
from piezo_hysteresis.model.provenance import with_origin
from piezo_hysteresis.record import Experiment, Record
from piezo_hysteresis.report.stage_verdict import stage_sentence

ONE_WAY = {
    "step": np.repeat([0.0, 5.0], (100, 400)),
    "ramp": np.interp(np.arange(500), [50, 200], [0.0, 5.0]),
}


@pytest.fixture(scope="module")
def model():
    return Model((BoucWen(A=-0.7, beta=4.6, gamma=-0.9, p1=-0.1, p2=2.2),), 1e-3, 10.0, 1e-5)


def record(model, drive, phase):
    return Record(drive, model.run(drive, model.rest(0.0))[0] + 1e-8 * np.sin(np.arange(drive.size)), 1e-3, phase=phase)


@pytest.mark.parametrize("phase", ONE_WAY)
def test_a_drive_that_only_holds_after_its_first_motion_is_judged_with_it(model, phase):
    check = check_stage(model, [record(model, ONE_WAY[phase], phase)])
    assert check.percent < 0.5
    assert not check.after_loop


@pytest.mark.parametrize("phase", ONE_WAY)
def test_a_recalibration_says_why_it_refuses_such_a_drive(model, phase):
    with pytest.raises(IdentificationError, match="does not move after it has been at both ends of its range"):
        recalibrate(model, Experiment((record(model, ONE_WAY[phase], phase),)))


def test_after_a_loop_the_past_does_not_count(model):
    drive = np.concatenate((ONE_WAY["ramp"], ONE_WAY["ramp"][::-1]))
    assert check_stage(model, [record(model, drive, "triangle")]).after_loop


def test_a_step_in_the_first_sample_counts_as_before(model):
    drive = np.full(500, 5.0)
    y, _ = model.run(drive, model.rest(0.0))
    assert check_stage(
        model, [Record(drive, y + 1e-8 * np.sin(np.arange(500)), 1e-3, phase="step", initial_voltage=0.0)]
    ).after_loop


def from_earlier_motion(model, drive):
    """A record of the unchanged stage, which had been driven to its top before."""
    before = np.concatenate((np.linspace(0.0, 8.0, 400), np.linspace(8.0, 0.0, 400)))
    y = model.run(np.concatenate((before, drive)), model.rest(0.0))[0][before.size :]
    noise = 1e-8 * np.random.default_rng(1).standard_normal(drive.size)
    return Record(drive, y + noise, 1e-3, phase="triangle")


def growing(amplitudes):
    return np.concatenate([a * np.interp(np.arange(400), [0, 200, 400], [0.0, 1.0, 0.0]) for a in amplitudes])


def test_a_drive_that_grows_to_its_end_still_depends_on_the_past(model):
    known = with_origin(model, Experiment((from_earlier_motion(model, growing([8.0])),)), 0.1, 2e-8, 2e-8, True)
    check = check_stage(known, [from_earlier_motion(model, growing([2.0, 3.0, 4.0, 5.0]))])
    assert not check.is_as_good  # the past alone: nothing in the stage has changed
    assert not check.after_loop
    assert "after its first full loop" not in stage_sentence(check, check.percent, ".")


def test_a_drive_that_is_largest_at_first_does_not(model):
    known = with_origin(model, Experiment((from_earlier_motion(model, growing([8.0])),)), 0.1, 2e-8, 2e-8, True)
    check = check_stage(known, [from_earlier_motion(model, growing([5.0, 4.0, 3.0, 2.0]))])
    assert check.is_as_good
    assert check.after_loop
