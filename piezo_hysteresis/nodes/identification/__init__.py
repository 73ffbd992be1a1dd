"""The identification node."""
