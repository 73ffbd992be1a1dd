"""Effects between the hysteresis output w and the position of the stage."""
