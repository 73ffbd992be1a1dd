"""Effects between the actuator input v and the hysteresis output w."""
