"""Effects between the drive voltage and the actuator."""
