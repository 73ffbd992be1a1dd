"""A model where there is no Python: C99 without dependencies, and FMI 3.0 co-simulation units around it."""

from .fmu import fmus
from .program import c_program

__all__ = ["c_program", "fmus"]
