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

"""Texts of the page: a change is written with its size where there is one, and without where there is none."""

import time

import numpy as np
import pytest

from piezo_hysteresis.report.live import panels
from piezo_hysteresis.report.live.axis_state import OK, STALE, WARN, AxisState, Status


def shown(level, **values):
    axis = AxisState("/stage_x")
    axis.change = Status("stage_x/model_node: change", level, "what the node says", values)
    return panels.alarms(axis)


@pytest.mark.parametrize(
    ("group", "unit", "change", "text"),
    [
        ("gain", "1", "0.0130241", "gain: 1.3 % (1 % to 2 %)"),
        ("dynamics", "s", "1.30241e-05", "dynamics: 13 µs (1e+04 µs to 2e+04 µs)"),
        ("offset", "m", "1.30241e-08", "offset: 13 nm (1e+07 nm to 2e+07 nm)"),
    ],
)
def test_a_change_has_a_size_and_its_interval(group, unit, change, text):
    values = {"group": group, "unit": unit, "change": change, "change_low": "0.01", "change_high": "0.02"}
    assert text in shown(WARN, statistic="5.21234", **values)
    assert "statistic 5.2, threshold 1" in shown(WARN, statistic="5.21234", **values)


def test_without_a_change_there_is_no_size_and_without_a_watch_no_statistic():
    values = {"statistic": "0.215539", "group": "loop", "unit": "1", "change": "0.0007"}
    assert "loop" not in shown(OK, **values)
    assert "0.22" in shown(OK, **values)
    assert "statistic" not in shown(STALE, statistic="0")


def test_the_verdict_stays_until_the_next_diagnosis_whatever_its_words_are():
    axis = AxisState("/stage_x")
    for message, conclusion in (("fitted", ""), ("a new sentence", "time_limit"), ("named: not really", "")):
        values = {"state": "done", "conclusion": conclusion}
        axis.report_identification(Status("stage_x/identification_node", OK, message, values))
    assert axis.verdict == "a new sentence"


def test_nothing_is_shown_as_present_that_a_silent_node_has_said():
    """The page went on to show 24 nm and a green badge 'predicting' after the model node was killed."""
    axis, index = AxisState("/stage_x"), np.arange(100, dtype=np.uint32)
    ago = time.monotonic() - 10.0
    axis.window.add(index, 1e-4 * index, np.full(100, 5.0), np.full(100, 2e-5))
    axis.phase, axis.residual_rms, axis.heard = "1 scan", 2.4e-8, ago
    for part in ("stage", "prediction", "identification"):
        axis.report(Status(f"stage_x/a_node: {part}", OK, "at work", {"model": "sha256:0123456789abcdef"}, ago))
    axis.identification = Status("stage_x/identification_node: identification", OK, "step 3", {"state": "running"}, ago)
    axis.change = Status("stage_x/model_node: change", OK, "no change", {}, ago)
    text = "".join(part(axis) for part in (panels.alarms, panels.identification, panels.model))
    text += panels.state(axis, None)
    for old in ("scan", "24 nm", "5.000 V", "at work", "step 3", "no change", "badge ok"):
        assert old not in text
    for node in ("driver", "model node", "identification node"):
        assert f"the {node} has been silent for 10 s" in text
