"""Effects of the displacement sensor."""
