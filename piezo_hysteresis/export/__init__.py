"""A model where there is no Python: C99 without dependencies."""

from .program import c_program

__all__ = ["c_program"]
