"""Effects of the material: laws of creep."""
