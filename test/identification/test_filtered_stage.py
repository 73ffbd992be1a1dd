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

"""A low-pass filter in the chain hides the ringing of the stage after a step; mode and filter are found together."""

import pytest

from benchmarks.nanopositioner import Nanopositioner, growing_sine
from benchmarks.rates import lag_holds
from piezo_hysteresis.effects import ExtraResonance
from piezo_hysteresis.identification.free_run_error import errors, free_per_record
from piezo_hysteresis.identification.identify import identify
from piezo_hysteresis.identification.steps.remaining_lag import amplifier_of, lag
from piezo_hysteresis.record import Experiment

PERIOD = 5e-4
FILTERS = {
    "drive": {"filter_drive": 2e-3},
    "pole": {"filter_pole": 3e-3},
    "butterworth": {"filter_twice": 1e-3},
    "mean": {"filter_mean": 1e-3},
}


def played(stage, *frequencies):
    records = (stage.play(growing_sine(f, PERIOD, (0.4, 1.0)), PERIOD, f"sine_{f:g}hz") for f in frequencies)
    return Experiment(tuple(records))


@pytest.mark.parametrize(
    ("name", "fitted", "judged"),
    [
        pytest.param("drive", (1.0, 60.0), 10.0, marks=pytest.mark.soak),
        pytest.param("mean", (1.0, 60.0), 10.0, marks=pytest.mark.soak),
        pytest.param("pole", (1.0, 10.0), 60.0, marks=pytest.mark.soak),
        ("butterworth", (1.0, 10.0), 60.0),
        pytest.param("drive", (1.0, 10.0), 60.0, marks=pytest.mark.soak),
        pytest.param("mean", (1.0, 10.0), 60.0, marks=pytest.mark.soak),
        pytest.param("pole", (1.0, 60.0), 10.0, marks=pytest.mark.soak),
        pytest.param("butterworth", (1.0, 60.0), 10.0, marks=pytest.mark.soak),
    ],
)
def test_a_filtered_stage_is_predicted_at_other_rates(name, fitted, judged):
    stage = Nanopositioner(mode=400.0, **FILTERS[name])
    found = identify(played(stage, *fitted), memory=True).model
    assert found[ExtraResonance.name]["f0"] == pytest.approx(400.0, rel=0.02)
    assert errors(found, played(stage, judged), free_per_record(found, offset=True)).percent < 0.12


@pytest.mark.parametrize(
    ("place", "late"), [("filter_drive", 6e-4), pytest.param("filter_pole", 2e-3, marks=pytest.mark.soak)]
)
def test_a_pole_is_found_where_it_is(place, late):
    stage = Nanopositioner(mode=400.0, pole=2e-5, **{place: late})
    found = identify(played(stage, 2.0, 60.0), memory=True)
    amplifier = amplifier_of(found.model)
    assert (amplifier is not None) == (place == "filter_drive")
    assert ("amplifier" in {n.kind for n in found.notices}) == (amplifier is not None)
    if amplifier:
        assert amplifier["tau"] == pytest.approx(late, rel=0.05)
    assert lag_holds(found, stage, PERIOD)


@pytest.mark.soak
def test_one_slow_rate_does_not_tell_where_the_pole_is():
    """The lag depends on the place, so its interval holds both."""
    stage = Nanopositioner(mode=400.0, filter_drive=1e-3)
    found = identify(played(stage, 1.0), memory=True)
    assert lag_holds(found, stage, PERIOD)
    settled = identify(played(stage, 1.0, 60.0), memory=True)
    assert lag(found.fit)[1] > 2.0 * lag(settled.fit)[1]


def test_the_lag_of_one_rate_is_not_taken_for_creep():
    """A slow pole, and a zero that nearly cancels it, would do what creep does, and leave the lag unknown."""
    found = identify(played(Nanopositioner(), 10.0), memory=True)
    assert lag(found.fit)[1] < 0.1 * PERIOD
    assert found.model["arx"].pole_radius < 0.8


@pytest.mark.soak
def test_no_low_pass_is_stated_that_the_stage_has_not():
    """A time constant of 0 s was stated as that of an amplifier."""
    stage = Nanopositioner(mode=500.0, zeta=0.0107, pole=1e-6, delay=1.6e-4)
    drives = {f"sine_{f:g}hz": growing_sine(f, PERIOD) for f in (1.0, 60.0)}
    found = identify(Experiment(tuple(stage.play(u, PERIOD, name) for name, u in drives.items())), memory=True)
    assert "amplifier" not in {notice.kind for notice in found.notices}
    assert lag_holds(found, stage, PERIOD)
    assert found.model["extra_resonance"]["f0"] == pytest.approx(stage.mode, rel=1e-3)
