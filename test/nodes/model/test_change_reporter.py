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

"""A change that the watch has found stays an alarm for the user, whatever keeps the watch from seeing more of it."""

import pytest

from piezo_hysteresis.report.live.axis_state import ERROR, WARN, AxisState

from .changed_stage import ChangedStage

pytestmark = pytest.mark.nodes


def test_an_alarm_remains_whatever_blinds_the_watch(lab, tmp_path):
    changed, axis = ChangedStage(lab, tmp_path), AxisState("/")
    known = changed.reported("the stage has changed: gain").values["change"]

    def check(reason):
        status = changed.reported(f"the stage has changed: gain; {reason}")
        assert status.level in (WARN, ERROR)
        axis.report(status)
        assert axis.alarms and not axis.past_alarms
        assert status.values["group"] == "gain"
        assert float(status.values["change"]) == pytest.approx(float(known), rel=0.1)
        assert float(status.values["statistic"]) > 1.0

    changed.play(1.0, lost=True)
    changed.play(0.1)
    check("voltages that were not received still influence the prediction")
    changed.play(2.0)
    check("the zero of the sensor is being measured")
    changed.play(10.0)
    changed.reported("the stage has changed: gain")
    changed.predictor.zero()
    changed.play(0.5)
    check("the zero of the sensor is being measured")
    changed.amplitude = 0.0
    changed.play(12.0)
    check("the present drive was not part of the baseline")
    changed.reporter.watch.take_baseline(20.0)
    check("taking the baseline")
    check("no prediction; are driver and model there?")
