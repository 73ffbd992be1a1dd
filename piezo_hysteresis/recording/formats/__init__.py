"""File formats other than bags."""
