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

"""What is saved of a stage of another form, of which no effect is named."""

from types import SimpleNamespace

import numpy as np
import pytest

from benchmarks.other_forms import KINDS, random_stage
from piezo_hysteresis import Experiment, Record, diagnose
from piezo_hysteresis.discrepancy import many_records
from piezo_hysteresis.discrepancy.verdict import Conclusion, Verdict
from piezo_hysteresis.effects import MainsHum
from piezo_hysteresis.identification.fit import time_limit

PERIOD, SIZE = 1e-3, 2000
TIME = PERIOD * np.arange(SIZE)


@pytest.fixture(scope="module")
def stage():
    return random_stage(KINDS["relays"], 0)


@pytest.fixture(scope="module")
def experiment(stage):
    noise = np.convolve(np.random.default_rng(7).normal(size=SIZE), np.ones(5) / 5, "same")
    fade = np.minimum(1.0, np.minimum(TIME, TIME[::-1]) / 0.3)
    drives = {
        "triangle_0": 10.0 * (1.0 - np.abs(2.0 * TIME % 2.0 - 1.0)),
        "triangle_1": 6.0 * (1.0 - np.abs(2.0 * TIME % 2.0 - 1.0)),
        "sine": 5.0 - 5.0 * np.cos(2.0 * np.pi * 5.0 * TIME),
        "noise": 5.0 * fade * (1.0 + noise / np.abs(noise).max()),
        "step": np.repeat((0.0, 3.0, 8.0, 10.0, 4.0), SIZE // 5),
    }
    return Experiment(tuple(recorded(stage, u, name) for name, u in drives.items()))


def recorded(stage, drive, phase="other"):
    return Record(drive, stage.play(drive, PERIOD).displacement, PERIOD, phase)


def test_the_saved_model_has_the_structure_of_identify(stage, experiment):
    """It was the published model, which has twice the error on other drives."""
    found = diagnose(experiment, effects=[MainsHum])
    assert found.verdict is Verdict.UNKNOWN and "structure that predicts best" in found.reason
    assert found.gap.after < 0.5 * found.gap.before
    levels = np.interp(TIME, PERIOD * np.array((0, 400, 700, 1200, 1600, 2000)), (0.0, 8.0, 4.0, 7.0, 1.0, 9.0))
    other = recorded(stage, levels)
    missed = [np.std(other.displacement - m.free_run([other])[0]) for m in (found.baseline, found.model)]
    assert missed[1] < 0.6 * missed[0]


def test_the_time_limit_ends_also_what_follows_the_search_for_effects(experiment, monkeypatch):
    """The search for a correction took a minute longer, and the answer did not say that it was not the best."""
    select = many_records.select

    def last_selected(*given):
        found = select(*given)
        monkeypatch.setattr(time_limit, "time", SimpleNamespace(monotonic=lambda: np.inf))
        return found

    monkeypatch.setattr(many_records, "select", last_selected)
    found = diagnose(experiment, effects=[MainsHum], time_limit=1e6)
    assert found.conclusion is Conclusion.UNEXPLAINED_GAP
    assert "The time limit ended the search" in found.reason
    assert found.correction is None and found.gap.after == found.gap.before
