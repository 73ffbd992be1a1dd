"""Effects of the material on w: creep."""
