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

"""`~/stop` is served as long as the driver runs, whatever becomes of an answer."""

import pytest
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.service import Service
from std_srvs.srv import Trigger

from piezo_hysteresis.nodes.driver.driver_node import DriverNode

pytestmark = pytest.mark.nodes


def test_an_answer_that_cannot_be_sent_does_not_end_the_services(lab, monkeypatch):
    node = lab.add(DriverNode, autostart=False)
    assert lab.call(Trigger, "driver_node/stop").success

    def fail(service, *arguments):
        raise rclpy_implementation.RCLError("failed to send response: client will not receive response")

    with monkeypatch.context() as patched:
        patched.setattr(Service, "send_response", fail)
        client = lab.node.create_client(Trigger, "driver_node/stop")
        lab.wait(client.service_is_ready, "the stop")
        client.call_async(Trigger.Request())
        lab.wait(lambda: node.faults, "the report of the fault")
    assert "failed to send response" in node.recent_fault
    for word in ("stop", "release"):
        assert lab.call(Trigger, f"driver_node/{word}").success
