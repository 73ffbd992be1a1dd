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

"""What a driver without a stage answers and leaves behind: nothing about a stage."""

import os
from dataclasses import replace

import pytest
from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.impl.implementation_singleton import rclpy_implementation
from std_srvs.srv import Trigger

from piezo_hysteresis.nodes.driver import driver_node
from piezo_hysteresis.nodes.driver.driver_node import DriverNode
from piezo_hysteresis.stage import back_ends
from piezo_hysteresis.stage.opening import BackEnd

from ...acquisition.witness import Witness

pytestmark = pytest.mark.nodes


def test_a_driver_that_does_not_know_its_stage_does_not_say_that_it_is_safe(lab):
    lab.driver(autostart=False)
    stopped, cancelled = (lab.call(Trigger, f"driver_node/{word}") for word in ("stop", "cancel"))
    assert stopped.success and not cancelled.success
    for answer in (stopped, cancelled):
        assert "does not know its stage" in answer.message
        assert "safe" not in answer.message
    assert "nothing moves until ~/release" in stopped.message


@pytest.mark.parametrize("failing", ["in_force.", "topics"])
def test_a_driver_that_cannot_be_configured_closes_its_stage(lab, monkeypatch, failing):
    """The middleware fails once, while limits or topics are published."""
    stages = [OwnWitness(1e-3, 100.0), OwnWitness(1e-3, 100.0)]
    opened = iter(stages)
    monkeypatch.setitem(back_ends.BACK_ENDS, "simulated", BackEnd("simulated", (), lambda *_: next(opened), True))
    node = lab.add(DriverNode, discovery_time=0.0, autostart=False)
    with monkeypatch.context() as patched:
        if failing == "topics":
            patched.setattr(driver_node, "DriverTopics", fail)
        else:
            events = node._parameter_event_publisher
            patched.setattr(node, "_parameter_event_publisher", FailsOnce(events, failing))
        assert not lab.transition("configure")
    assert stages[0].closed == 1
    assert node.get_parameter("in_force.sample_period").value == 0.0
    assert node.count_publishers("samples") == 0
    assert "cannot publish" in node._diagnostics._state[1]
    assert lab.transition("configure")
    assert lab.transition("activate")
    lab.streaming()


def test_a_fault_of_a_driver_that_is_not_configured_is_a_warning(lab):
    reports = lab.diagnostics()
    lab.add(DriverNode, autostart=False).fault(ValueError("broken"))
    lab.wait(lambda: any("broken" in s.message for a in list(reports) for s in a.status), "the fault")
    status = next(s for a in list(reports) for s in a.status if "broken" in s.message)
    assert status.message.startswith("not configured; ")
    assert status.level == DiagnosticStatus.WARN


class OwnWitness(Witness):
    """A stage of this process alone."""

    def __init__(self, *arguments):
        super().__init__(*arguments)
        self.description = replace(self.description, name=f"witness {os.getpid()}")  # tests may run side by side


def fail(*arguments):
    raise rclpy_implementation.RCLError("cannot publish")


class FailsOnce:
    """A publisher of parameter events that fails at the first parameter of a group."""

    def __init__(self, publisher, group):
        self._publisher, self._group = publisher, group

    def __getattr__(self, name):
        return getattr(self._publisher, name)

    def publish(self, message):
        if self._group and any(parameter.name.startswith(self._group) for parameter in message.changed_parameters):
            self._group = ""
            fail()
        self._publisher.publish(message)
