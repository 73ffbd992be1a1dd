"""Effects from w to the position of the stage."""
