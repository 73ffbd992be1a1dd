"""Checks of the recorded data: gaps, defective channels, initial conditions."""
