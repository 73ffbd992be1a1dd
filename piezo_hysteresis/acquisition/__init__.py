"""Runs a stage without ROS: plays waveforms inside the limits and collects blocks of samples."""
