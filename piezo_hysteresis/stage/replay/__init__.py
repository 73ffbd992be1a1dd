"""A recording in place of a device, and how a driver opens it: PARAMETERS and `open`."""

from .back_end import PARAMETERS, open
from .stage import ReplayStage

__all__ = ["PARAMETERS", "ReplayStage", "open"]
