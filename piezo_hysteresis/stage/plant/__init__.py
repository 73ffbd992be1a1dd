"""The physics of the simulated stage, part by part; shares no code with the model it is used to test."""

from .parameters import PlantParameters
from .plant import Plant, Reading

__all__ = ["Plant", "PlantParameters", "Reading"]
