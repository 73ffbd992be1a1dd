"""The driver node: owns one stage and publishes its samples."""
