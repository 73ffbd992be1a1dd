"""Reads and writes rosbag2 recordings."""
