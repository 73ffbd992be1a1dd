"""ROS 2 nodes: parameters in, messages to arrays, one call of the core, messages out."""
