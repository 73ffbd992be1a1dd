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

"""Ramp a stage to a voltage from any lab software: `python set_voltage.py 5.0 --ros-args -r __ns:=/stage_x`."""

import argparse

import rclpy
from rclpy.duration import Duration
from rclpy.utilities import remove_ros_args
from std_msgs.msg import Float64

parser = argparse.ArgumentParser(description="Ramp a stage to a voltage.")
parser.add_argument("voltage", type=float, help="[V]")
voltage = parser.parse_args(remove_ros_args()[1:]).voltage
rclpy.init()
node = rclpy.create_node("set_voltage")
publisher = node.create_publisher(Float64, "set_voltage", 10)
while not publisher.get_subscription_count():  # until the driver is found
    rclpy.spin_once(node, timeout_sec=0.1)
publisher.publish(Float64(data=voltage))
publisher.wait_for_all_acked(Duration(seconds=5.0))
