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

"""Play a waveform on a stage from any lab software: `python send_waveform.py --ros-args -r __ns:=/stage_x`.

No message of this package is needed: a waveform is a standard point cloud with one field, `voltage`. A second field of
the same bytes names the phase.
"""

import array

import numpy as np
import rclpy
from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.duration import Duration
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.task import Future
from sensor_msgs.msg import PointCloud2, PointField

SAMPLE_PERIOD = 20e-6  # s, that of the driver

time = SAMPLE_PERIOD * np.arange(50_000)
voltage = 2.5 - 2.5 * np.cos(2 * np.pi * 10.0 * time)  # V: 10 Hz for 1 s, from 0 to 5 V

rclpy.init()
node = rclpy.create_node("send_waveform")
publisher = node.create_publisher(PointCloud2, "command", 10)
while not publisher.get_subscription_count():  # until the driver is found
    rclpy.spin_once(node, timeout_sec=0.1)

waveform = PointCloud2(height=1, width=voltage.size, point_step=8, row_step=8 * voltage.size, is_dense=True)
waveform.fields = [
    PointField(name=name, offset=0, datatype=PointField.FLOAT64, count=1)
    for name in ("voltage", "phase:my_sine")  # the same bytes: what they are, and the name of the phase
]
waveform.data = array.array("B", voltage.tobytes())
waveform.header.stamp = node.get_clock().now().to_msg()  # an old command is refused; without a stamp it never is

stamp = f"{waveform.header.stamp.sec}.{waveform.header.stamp.nanosec:09d}"  # statuses of other commands arrive, too

finished = Future()


def on_status(status: DiagnosticStatus) -> None:
    """Print the status of the driver about our waveform."""
    values = {value.key: value.value for value in status.values}
    if (status.name, values["stamp"]) == ("my_sine", stamp):
        state = values["state"]
        print(f"{status.name}: {state}" + (f", {status.message}" if state == "refused" else ""))
        if state in ("refused", "done", "stopped"):
            finished.set_result(state)


latched = QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL)
node.create_subscription(DiagnosticStatus, "command_status", on_status, latched)
publisher.publish(waveform)
publisher.wait_for_all_acked(Duration(seconds=5.0))
rclpy.spin_until_future_complete(node, finished, timeout_sec=30.0)
raise SystemExit(0 if finished.done() and finished.result() == "done" else 1)
