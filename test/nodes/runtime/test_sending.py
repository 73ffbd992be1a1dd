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

"""A message that the middleware does not take is lost; the node lives on."""

import pytest
from rclpy.impl.implementation_singleton import rclpy_implementation
from std_msgs.msg import Float64

from piezo_hysteresis.nodes.runtime.sending import ATTEMPTS, send

pytestmark = pytest.mark.nodes


class Busy:
    """A publisher whose middleware is short of time for the first attempts."""

    def __init__(self, refusals):
        self.refusals, self.taken = refusals, []

    def publish(self, message):
        if self.refusals:
            self.refusals -= 1
            raise rclpy_implementation.RCLError("Failed to publish: cannot publish data")
        self.taken.append(message)


def test_a_message_that_is_not_taken_at_once_is_sent_again():
    publisher = Busy(ATTEMPTS - 1)
    assert send(publisher, Float64(data=1.0))
    assert publisher.taken == [Float64(data=1.0)]


def test_one_that_is_never_taken_is_lost():
    assert not send(Busy(ATTEMPTS), Float64())
