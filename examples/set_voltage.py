"""Ramp a stage to a voltage from any lab software: `python set_voltage.py 5.0 --ros-args -r __ns:=/stage_x`."""

import sys

import rclpy
from rclpy.duration import Duration
from std_msgs.msg import Float64

rclpy.init()
node = rclpy.create_node("set_voltage")
publisher = node.create_publisher(Float64, "set_voltage", 10)
while not publisher.get_subscription_count():  # until the driver is found
    rclpy.spin_once(node, timeout_sec=0.1)
publisher.publish(Float64(data=float(sys.argv[1])))  # V
publisher.wait_for_all_acked(Duration(seconds=5.0))
