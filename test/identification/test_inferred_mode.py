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

"""Nothing false is stated about a mode that only the gain shows: the lag is determined, its parts have no interval."""

import numpy as np
import pytest

from benchmarks.nanopositioner import Nanopositioner
from piezo_hysteresis.cli.model.identify import answer
from piezo_hysteresis.identification.identified_range import LAG_ERROR
from piezo_hysteresis.identification.identify import identify
from piezo_hysteresis.identification.steps.remaining_lag import error_of_lag, lag
from piezo_hysteresis.identification.structure.mode import assumed_numbers, mode_is_inferred
from piezo_hysteresis.record import Experiment
from piezo_hysteresis.report.tables.parameter_table import parameter_table

PERIOD = 5e-4


def sine(frequency):
    """Three cycles from 0 V to 10 V after a rest; nothing in it makes a mode ring."""
    time = PERIOD * np.arange(round(3.0 / (frequency * PERIOD)))
    return np.concatenate((np.zeros(200), 5.0 * (1.0 - np.cos(2.0 * np.pi * frequency * time))))


def identified(stage):
    """From three rates."""
    return identify(
        Experiment(tuple(stage.play(sine(f), PERIOD, f"sine_{f:g}hz") for f in (2.0, 10.0, 60.0))), memory=True
    )


@pytest.mark.parametrize("seed", [1, pytest.param(2, marks=pytest.mark.soak), pytest.param(3, marks=pytest.mark.soak)])
def test_the_lag_is_inside_its_interval_and_what_was_assumed_has_none(seed):
    rng = np.random.default_rng(seed)
    stage = Nanopositioner.random(rng, mode=float(rng.uniform(400.0, 720.0)))
    found = identified(stage)
    assert mode_is_inferred(found.model)
    value, error = lag(found.fit)
    assert abs(value - stage.sampled_lag(PERIOD)) < 1.96 * error < 0.3 * value
    stated = answer(found, "model.yaml")["parameters"]
    for table in (parameter_table(found.model, found.fit), parameter_table(found.model)):
        shown = {row[0]: row[3] for row in table.rows}
        assert any(shown.values())
        for name in assumed_numbers(found.model):
            assert stated[name]["interval_95"] is None
            assert shown[name] == ""
    (message,) = (n.message for n in found.notices if n.kind == "lag_only")
    assert f"together with the mode, {1e3 * value:.4g} ms" in message
    assert "Hz, the gain is not known" in message


def test_the_assumed_form_of_the_mode_counts_in_the_lag_even_beside_a_pole():
    """The lag alone is known to 0.01 ms, but at 90 Hz the model is off by more than this allows."""
    stage = Nanopositioner.random(np.random.default_rng(1))
    model = identified(stage).model
    assert mode_is_inferred(model)
    assert len(model["arx"].array("a")) == 1
    faster = stage.play(sine(90.0), PERIOD)
    error = (faster.displacement - model.simulate(faster)[0])[200:]
    allowed = error_of_lag(float(model.provenance[LAG_ERROR]), 90.0)
    assert np.std(error) < allowed * np.ptp(faster.displacement)
