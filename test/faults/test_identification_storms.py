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

"""An identification node that is asked everything at once, without order; from several seeds."""

import random

import numpy as np
import pytest
from rcl_interfaces.msg import ParameterValue
from rcl_interfaces.srv import SetParameters
from rclpy.parameter import Parameter
from std_srvs.srv import Trigger

from .campaign import NODE, Campaign

pytestmark = [pytest.mark.nodes, pytest.mark.soak]


def odd_parameters(chance):
    """Parameters of every type, some of a type that does not exist."""
    names = ["seed", "protocol", "driver", "experiment", "model.valid", "use_sim_time", "x" * 5000, "", "."]
    values = [-3, 2**63 - 1, float("nan"), "word\x00\n", True, [1, 2], ["a"], [float("inf")], [b"\x00"]]
    message = Parameter(chance.choice(names), value=chance.choice(values)).to_parameter_msg()
    if chance.random() < 0.1:
        message.value = ParameterValue(type=99)
    return SetParameters.Request(parameters=[message])


@pytest.mark.parametrize("number", [1, 2, 3])
def test_storms_of_calls_and_parameters_leave_an_identification_that_works(lab, number):
    """Identify, diagnose, plan, abort and parameters without order, hundreds of them."""
    campaign, chance, asked = Campaign(lab), random.Random(number), []
    campaign.await_limits()
    words = ("identify", "diagnose", "abort", "plan")
    clients = {name: lab.node.create_client(Trigger, f"{NODE}/{name}") for name in words}
    parameters = lab.node.create_client(SetParameters, f"{NODE}/set_parameters")
    for client in (*clients.values(), parameters):
        lab.wait(client.service_is_ready, "the services")
    for _ in range(300):
        asked.append(clients[chance.choice(words)].call_async(Trigger.Request()))
        asked.append(parameters.call_async(odd_parameters(chance)))
        lab.pause(0.01)
    lab.wait(lambda: sum(future.done() for future in asked) > 100, "answers")
    campaign.ask("abort")
    assert campaign.node.is_running
    assert campaign.driver.is_running
    campaign.rests()
    campaign.begin()
    first, second = campaign.ask("diagnose"), campaign.ask("identify")
    assert first.message.startswith("busy")
    assert second.message.startswith("busy")
    assert campaign.ask("abort").success
    campaign.rests()
    campaign.check()
    assert np.isfinite(campaign.samples.displacement).all()
