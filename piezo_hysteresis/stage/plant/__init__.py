"""The physics of the simulated stage, part by part. It shares no code with the model."""

from .parameters import PlantParameters
from .plant import Plant, Reading

__all__ = ["Plant", "PlantParameters", "Reading"]
