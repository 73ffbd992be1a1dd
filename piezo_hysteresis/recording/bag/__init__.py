"""rosbag2 recordings of the nodes and of other software."""
