"""Drives a stage without ROS: blocks to and from it, playback, session."""
