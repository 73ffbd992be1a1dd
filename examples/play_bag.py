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

"""Play a bag where there is no `ros2 bag play`: `python play_bag.py BAG [--rate 2] [--topics /samples /model]`.

Every message is published as it was recorded, on its own topic (`--ros-args -r /samples:=/replay/samples` renames it).
/clock follows the times of the bag, so start the nodes with use_sim_time. A recorded `command` is too old to move a
stage.
"""

import argparse
import sys
import time
from importlib import import_module
from pathlib import Path

import rclpy
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.utilities import remove_ros_args
from rosgraph_msgs.msg import Clock

from piezo_hysteresis.recording import Bag

LATCHED = QoSProfile(
    depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL
)  # nodes that subscribe later receive it, too
DISCOVERY = 3.0  # s; then the bag is played even if some topics have no subscriber
CLOCK_STEP = 0.001  # s between two messages of /clock

parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
parser.add_argument("bag", help="folder, or .mcap or .db3 file")
parser.add_argument("--rate", type=float, default=1.0, help="speed of playing")
parser.add_argument("--topics", nargs="*", help="topics to play; default all")
options = parser.parse_args(remove_ros_args(sys.argv)[1:])

rclpy.init()
node = rclpy.create_node("play_bag")
clock = node.create_publisher(Clock, "/clock", 10)


def publisher(topic: str, kind: str) -> Publisher:
    """Publisher of a topic of the bag."""
    package, _, name = kind.split("/")
    return node.create_publisher(getattr(import_module(f"{package}.msg"), name), topic, LATCHED)


bag = Bag(Path(options.bag))
kinds = {message.topic: message.type for message in bag.messages(options.topics)}
publishers = {topic: publisher(topic, kind) for topic, kind in kinds.items()}
deadline = time.monotonic() + DISCOVERY
while time.monotonic() < deadline and not all(p.get_subscription_count() for p in publishers.values()):
    time.sleep(0.05)

began, first, published = time.monotonic(), None, 0
for message in bag.in_time_order(options.topics):
    first = first or message.time_ns
    due = began + (message.time_ns - first) * 1e-9 / options.rate
    time.sleep(max(0.0, due - time.monotonic()))
    if message.time_ns - published >= CLOCK_STEP * 1e9:
        published = message.time_ns
        now = Clock()
        now.clock.sec, now.clock.nanosec = divmod(published, 1_000_000_000)
        clock.publish(now)
    publishers[message.topic].publish(message.raw)
for one in publishers.values():
    one.wait_for_all_acked()
print(f"played {len(publishers)} topics of {options.bag}")
