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

"""A stop is not kept waiting by what the driver is at work on, and what was on its way before is refused after it."""

import threading

import numpy as np
import pytest
from std_srvs.srv import Trigger

from piezo_hysteresis.nodes.driver import commands
from piezo_hysteresis.nodes.driver.driver_node import DriverNode
from piezo_hysteresis.stage import back_ends
from piezo_hysteresis.stage.opening import BackEnd

from ...acquisition.witness import Witness

pytestmark = pytest.mark.nodes

PERIOD = 1e-3


def test_a_stop_in_the_middle_of_a_large_command_acts_before_it_is_decoded(lab, monkeypatch):
    """The thread that decodes commands stands still inside one, and others wait behind it, when the stop comes."""
    stage, decoding, go_on = Witness(PERIOD, 1e6), threading.Event(), threading.Event()
    monkeypatch.setitem(back_ends.BACK_ENDS, "simulated", BackEnd("simulated", (), lambda *_: stage, is_device=True))
    node = lab.add(DriverNode, discovery_time=0.0, ramp_rate=50.0)
    lab.do(node.begin)
    other = lab.second_node("operator")
    stop = other.create_client(Trigger, "driver_node/stop")
    lab.wait(stop.service_is_ready, "the stop")
    statuses, decode = lab.statuses(), commands.waveform_from_cloud
    lab.send(np.concatenate((np.linspace(0, 5, 500), np.full(100_000, 5.0))), "rise", PERIOD)
    lab.wait(lambda: stage.voltage == 5.0, "the top")

    def slow(*arguments):
        decoding.set()
        assert go_on.wait(60.0)
        return decode(*arguments)

    monkeypatch.setattr(commands, "waveform_from_cloud", slow)
    for name in ("large", "behind_it", "last"):
        lab.send(np.zeros(10), name, PERIOD)
    lab.wait(decoding.is_set, "the command")
    asked = stop.call_async(Trigger.Request())
    lab.wait(asked.done, "the answer to the stop")
    lab.wait(lambda: stage.voltage == 0.0, "the safe voltage")
    assert not go_on.is_set()
    assert asked.result().success
    go_on.set()
    lab.wait(lambda: lab.states(statuses, "last"), "what becomes of the commands")
    for name in ("large", "behind_it", "last"):
        assert lab.states(statuses, name) == ["refused"]
    assert all("call ~/release first" in s.message for s in statuses if s.name in ("large", "behind_it", "last"))
    assert stage.voltage == 0.0
