"""ROS 2 nodes. They turn messages into arrays, call the core, and publish the result."""
