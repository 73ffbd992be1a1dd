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

"""Samples do not show when between them a stage moves: a lag of a sample is known only as far as that allows."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.nanopositioner import Nanopositioner, growing_sine
from piezo_hysteresis.changes.change_sentence import UNSEEN, sentence_of
from piezo_hysteresis.changes.parameter_changes import find_change
from piezo_hysteresis.identification.identify import identify
from piezo_hysteresis.identification.records.noise_floor import floors
from piezo_hysteresis.record import Experiment

PERIOD = 1e-3


def played(stage, frequencies=(1.0, 10.0, 60.0)):
    return Experiment(tuple(stage.play(growing_sine(f, PERIOD), PERIOD, f"sine_{f:g}hz") for f in frequencies))


def change_of(model, stage):
    records = played(stage, (1.0, 60.0)).records
    least = np.maximum(floors(records), float(model.provenance["free_run_error"]))
    return find_change(model, records, range(2), least.tolist())


MODES = [
    pytest.param((783.0, 6e-4), marks=pytest.mark.soak),
    pytest.param((1310.0, 6e-4), marks=pytest.mark.soak),
    pytest.param((2747.0, 2e-5), marks=pytest.mark.soak),
    (2747.0, 6e-4),
]
"""Frequencies [Hz] and delays [s]."""


@pytest.fixture(scope="module", params=MODES, ids=str)
def stage_and_model(request):
    """Stages with a mode above half the sampling rate, which move within one sample."""
    mode, delay = request.param
    stage = Nanopositioner(mode=mode, zeta=0.03, pole=2e-5, delay=delay)
    return replace(stage, noise_seed=1), identify(played(stage), memory=True).model


@pytest.mark.parametrize("tau", [1.6e-3, pytest.param(3.2e-3, marks=pytest.mark.soak)])
def test_the_lag_of_a_filter_is_within_its_interval(stage_and_model, tau):
    """The samples of the stage without the filter have another lag than the stage, by up to half a sample."""
    stage, model = stage_and_model
    change = change_of(model, replace(stage, filter_pole=tau))
    if change is not None:
        late, low, high = change.lag
        assert change.kind.family == "lag" and low <= tau <= high
        assert high - late > 0.5 * PERIOD and UNSEEN in sentence_of(change)
    assert change is not None or tau < 2.0 * PERIOD


@pytest.mark.parametrize(
    "factor", [pytest.param(0.8, marks=pytest.mark.soak), pytest.param(0.93, marks=pytest.mark.soak), 1.06]
)
def test_a_mode_between_samples_that_has_moved_is_not_a_lag(stage_and_model, factor):
    """Only its ringing in the samples has changed, and with it their lag."""
    stage, model = stage_and_model
    change = change_of(model, replace(stage, mode=factor * stage.mode))
    assert change is None or change.kind.family != "lag"
