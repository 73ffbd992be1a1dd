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

"""`ChangedStage`: a stage whose gain has changed since its baseline, as its change watch has reported."""

import numpy as np
from diagnostic_msgs.msg import DiagnosticStatus

from piezo_hysteresis.acquisition.sample_block import SampleBlock
from piezo_hysteresis.effects import Arx, BoucWen
from piezo_hysteresis.model.model import Model
from piezo_hysteresis.nodes.model.change_reporter import ChangeReporter
from piezo_hysteresis.nodes.page.axis_feed import to_status
from piezo_hysteresis.nodes.runtime.guarded_node import GuardedNode
from piezo_hysteresis.online.predictor import Predictor
from piezo_hysteresis.report.live.axis_state import STALE

PERIOD, SIZE = 2e-3, 50
MODEL = Model((BoucWen(), Arx(a=[-0.6], b=[0.2])), PERIOD, displacement_scale=1e-5)


class WatchNode(GuardedNode):
    """The node of the change watch."""

    def __init__(self, **named):
        super().__init__("model_node", **named)

    def end(self):
        """Nothing moves."""


class ChangedStage:
    """A stage under a sine of 11 Hz, its predictor, and what the change watch publishes about it."""

    def __init__(self, lab, folder):
        self.lab, self.published = lab, lab.listen(DiagnosticStatus, "change")
        values = {"false_alarm_interval": 86400.0, "baseline_time": 20.0, "baseline_folder": str(folder)}
        self.node = lab.add(WatchNode)
        self.reporter = ChangeReporter(self.node, values)
        self.predictor, self.state, self.count = Predictor(PERIOD, MODEL), MODEL.rest(3.5), 0
        self.gain, self.amplitude, self.noise = 1.0, 2.5, np.random.default_rng(5)
        self.followers = [self.reporter]
        self.play(1.0)
        self.reporter.watch.take_baseline(20.0)
        self.play(24.0)
        self.reported("no change since the baseline")
        self.play(1.0, lost=True)
        self.play(0.1)
        assert self.reported("voltages that were not received still influence the prediction").level == STALE
        self.play(10.0)
        self.reported("no change since the baseline")
        self.gain = 1.005
        self.play(8.0)
        self.reported("the stage has changed: gain")

    def play(self, seconds, lost=False):
        """Continue for some time; the samples of lost blocks are not received."""
        for _ in range(round(seconds / PERIOD / SIZE)):
            index = np.arange(self.count, self.count + SIZE)
            u = 3.5 + self.amplitude * np.sin(2 * np.pi * 11.0 * PERIOD * index) * (index > 100)
            y, self.state = MODEL.run(u, self.state)
            y = self.gain * y + 2e-9 * self.noise.standard_normal(SIZE)
            stamp, time = round(self.count * PERIOD * 1e9), PERIOD * np.arange(SIZE)
            block = SampleBlock(stamp, time, u, y, index.astype(np.uint32), np.zeros(SIZE, np.uint32), "bench")
            if not lost:
                answer = self.predictor.predict(self.count, stamp, u, y)
                for follower in self.followers:
                    follower.add(block, answer, self.predictor)
            self.count += SIZE

    def reported(self, what):
        """The newest status, once it says this."""
        self.lab.wait(lambda: self.published and self.published[-1].message == what, f"'{what}'")
        return to_status(self.published[-1])
