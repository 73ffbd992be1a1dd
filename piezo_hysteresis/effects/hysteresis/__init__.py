"""Effects from the actuator input v to the hysteresis output w."""
