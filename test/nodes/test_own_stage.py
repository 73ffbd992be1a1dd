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

"""The worked example of a back end, driven by the driver as a stage that it has never heard of."""

import runpy
from pathlib import Path

import numpy as np
import pytest

from piezo_hysteresis.nodes.driver.driver_node import DriverNode
from piezo_hysteresis.stage import back_ends
from piezo_hysteresis.stage.opening import BackEnd
from piezo_hysteresis.stage.simulated import SimulatedStage
from piezo_hysteresis.stage.stage import Stage, StreamingStage

pytestmark = pytest.mark.nodes

EXAMPLE = Path(__file__).parents[2] / "examples" / "own_stage.py"
PERIOD = 1e-3


def test_the_example_is_short_and_whole(lab, monkeypatch):
    assert len(EXAMPLE.read_text().splitlines()) < 170
    own_stage = runpy.run_path(str(EXAMPLE))["OwnStage"]
    promised = {name for part in (Stage, StreamingStage) for name in vars(part) if not name.startswith("_")}
    assert promised <= set(dir(own_stage))

    device = SimulatedStage(sample_period=PERIOD)

    def opened(*_):
        return own_stage("bench 3", device.set_voltage, device.read_displacement, voltage_max=10.0, max_slew_rate=2e3)

    monkeypatch.setitem(back_ends.BACK_ENDS, "simulated", BackEnd("simulated", (), opened, is_device=True))
    node = lab.add(DriverNode, discovery_time=0.0, sample_period=PERIOD)
    lab.do(node.begin)
    samples, statuses = lab.streaming(), lab.statuses()
    wave = np.linspace(0.0, 4.0, 300)
    lab.send(wave, "up", PERIOD)
    lab.wait(lambda: "done" in lab.states(statuses, "up"), "the end of the command")
    assert samples.played(wave, lab.value(statuses, "up", "done", "first_index"), 1)
    assert device.voltage == pytest.approx(4.0, abs=1e-3)
    assert np.ptp(samples.displacement) > 10e-6
    assert lab.transition("deactivate")
    assert device.voltage == 0.0
