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

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticStatus

from piezo_hysteresis.acquisition.sample_block import SampleBlock
from piezo_hysteresis.effects import Arx, BoucWen
from piezo_hysteresis.model.model import Model
from piezo_hysteresis.nodes.model.change_reporter import ChangeReporter
from piezo_hysteresis.nodes.page.axis_feed import to_status
from piezo_hysteresis.online.predictor import Predictor
from piezo_hysteresis.report.live.axis_state import ERROR, STALE, WARN, AxisState

pytestmark = pytest.mark.nodes

PERIOD, SIZE = 2e-3, 50
MODEL = Model((BoucWen(), Arx(a=[-0.6], b=[0.2])), PERIOD, displacement_scale=1e-5)


class Stage:
    """A stage under a sine of 11 Hz, its predictor, and what the change watch publishes about it."""

    def __init__(self, lab, folder):
        self.lab, self.published = lab, lab.listen(DiagnosticStatus, "change")
        values = {"false_alarm_interval": 86400.0, "baseline_time": 20.0, "baseline_folder": str(folder)}
        self.reporter = ChangeReporter(lab.second_node("model_node"), values)
        self.predictor, self.state, self.count = Predictor(PERIOD, MODEL), MODEL.rest(3.5), 0
        self.gain, self.amplitude, self.noise = 1.0, 2.5, np.random.default_rng(5)

    def play(self, seconds, lost=False):
        for _ in range(round(seconds / PERIOD / SIZE)):
            index = np.arange(self.count, self.count + SIZE)
            u = 3.5 + self.amplitude * np.sin(2 * np.pi * 11.0 * PERIOD * index) * (index > 100)
            y, self.state = MODEL.run(u, self.state)
            y = self.gain * y + 2e-9 * self.noise.standard_normal(SIZE)
            stamp, time = round(self.count * PERIOD * 1e9), PERIOD * np.arange(SIZE)
            block = SampleBlock(stamp, time, u, y, index.astype(np.uint32), np.zeros(SIZE, np.uint32), "bench")
            if not lost:
                answer = self.predictor.predict(self.count, stamp, u, y)
                self.reporter.add(block, answer, self.predictor)
            self.count += SIZE

    def reported(self, what):
        """The newest status, once it says this."""
        self.lab.wait(lambda: self.published and self.published[-1].message == what, f"'{what}'")
        return to_status(self.published[-1])


@pytest.fixture
def changed(lab, tmp_path):
    """A stage whose gain has changed since its baseline, which was reported."""
    stage = Stage(lab, tmp_path)
    stage.play(1.0)
    stage.reporter.watch.take_baseline(20.0)
    stage.play(24.0)
    stage.reported("no change since the baseline")
    stage.play(1.0, lost=True)
    stage.play(0.1)
    assert stage.reported("voltages that were not received still influence the prediction").level == STALE
    stage.play(10.0)
    stage.reported("no change since the baseline")
    stage.gain = 1.005
    stage.play(8.0)
    stage.reported("the stage has changed: gain")
    return stage


def test_an_alarm_remains_whatever_blinds_the_watch(changed):
    axis = AxisState("/")
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
