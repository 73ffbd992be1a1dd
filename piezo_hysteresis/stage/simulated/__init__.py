"""Simulated stages, and how a driver opens one: PARAMETERS and `open`."""

from .back_end import PARAMETERS, open
from .stages import SimulatedMemoryStage, SimulatedStage

__all__ = ["PARAMETERS", "SimulatedMemoryStage", "SimulatedStage", "open"]
