"""Compensation: a model turned round drives the stage where it should go."""

from .band import Band
from .inverse import Inverse, InverseState
from .limits import Limits

__all__ = ["Band", "Inverse", "InverseState", "Limits"]
