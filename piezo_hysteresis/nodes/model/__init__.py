"""The model node."""
