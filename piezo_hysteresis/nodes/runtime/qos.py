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

"""Quality of service of every topic; a depth covers the longest stall times the message rate."""

from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

SAMPLES = QoSProfile(depth=100, reliability=ReliabilityPolicy.RELIABLE)
"""`samples`, `predicted_samples`: one second of blocks of 10 ms."""

COMMAND = QoSProfile(depth=10, reliability=ReliabilityPolicy.RELIABLE)
"""`command`, `set_voltage`, and the live scalars."""

LATCHED = QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL)
"""`phase`, `model`, `claimed_by`: a late joiner gets the last one."""

STATUS = QoSProfile(depth=100, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL)
"""`status`: a subscriber that was busy still gets every phase of an experiment.

A late joiner of depth 1 gets the last one.
"""

COMMAND_STATUS = QoSProfile(
    depth=10, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL
)
"""`command_status`: a late joiner gets the last ten."""

DEEP = QoSProfile(depth=1000, reliability=ReliabilityPolicy.RELIABLE)
"""Subscriptions that must not miss a block while the machine is busy: ten seconds of blocks of 10 ms."""
