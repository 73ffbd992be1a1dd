"""File formats other than bags: NPZ, CSV, MAT and GCS arrays."""
