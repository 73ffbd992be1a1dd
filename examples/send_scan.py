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

"""Send the stage along a scan [m] from any lab software: `python send_scan.py --ros-args -r __ns:=/stage_x`.

Both fields lie on the same bytes: one says what they are, the other gives the name of the phase.
"""

import numpy as np
import rclpy
from rclpy.duration import Duration
from sensor_msgs.msg import PointCloud2, PointField

path = 10e-6 + 5e-6 * np.sin(2 * np.pi * 10.0 * 20e-6 * np.arange(50_000))  # m: 10 Hz for 1 s at the driver's 20 µs
fields = [PointField(name=name, datatype=PointField.FLOAT64, count=1) for name in ("displacement", "phase:my_scan")]
scan = PointCloud2(height=1, width=path.size, fields=fields, point_step=8, row_step=path.nbytes, data=path.tobytes())
rclpy.init()
node = rclpy.create_node("send_scan")
publisher = node.create_publisher(PointCloud2, "trajectory", 10)
while not publisher.get_subscription_count():  # until the compensation node is found
    rclpy.spin_once(node, timeout_sec=0.1)
publisher.publish(scan)
publisher.wait_for_all_acked(Duration(seconds=5.0))
