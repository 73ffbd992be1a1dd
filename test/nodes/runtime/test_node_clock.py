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

"""The time of a node is the computer's, and simulated time where that is asked for."""

import time

import pytest
import rclpy
from rclpy.context import Context
from rclpy.parameter import Parameter
from rclpy.time import Time

from piezo_hysteresis.nodes.runtime.node_clock import now

pytestmark = pytest.mark.nodes


@pytest.fixture
def node():
    context = Context()
    rclpy.init(context=context)
    node = rclpy.create_node("node_clock", context=context)
    yield node
    node.destroy_node()
    context.shutdown()


def test_between_two_looks_at_the_clock_of_the_computer(node):
    before = time.time_ns()
    assert before <= now(node) <= time.time_ns()
    assert now(node) <= node.get_clock().now().nanoseconds


def test_simulated_time_starts_with_its_parameter(node):
    node.set_parameters([Parameter("use_sim_time", value=True)])
    node.get_clock().set_ros_time_override(Time(nanoseconds=123))
    assert now(node) == 123
    node.set_parameters([Parameter("use_sim_time", value=False)])
    assert now(node) > 123
