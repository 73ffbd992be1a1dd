"""Zero of the displacement sensor: not a physical effect, but part of every comparison with a measurement."""

from __future__ import annotations

import numpy as np

from ..parameter import Parameter
from .block import Array, Block, MemorylessBlock
from .effect import Effect, Place, Setting


class Offset(Effect):
    """y + y0: reading of the sensor where the model is at zero.

    Parameters
    ----------
    y0 : float
        Sensor zero [m].
    """

    name = "offset"
    family = "sensor"
    place = Place.ENVIRONMENT
    equation = "y = x + y0"
    signature = "a constant"
    source = "definition of the sensor's zero"
    parameters = (Parameter("y0", "y0", "m", 0.0, -1.0, 1.0, "reading at zero displacement", "definition", 0.0, 1e-6),)

    def block(self, setting: Setting, terms: tuple[Effect, ...] = ()) -> Block:
        return OffsetBlock(self["y0"])


class OffsetBlock(MemorylessBlock):
    """x + y0."""

    names = ("offset.y0",)

    def __init__(self, y0: float) -> None:
        self.y0 = y0

    def value(self, x: Array) -> Array:
        return x + self.y0

    def slope(self, x: Array) -> Array:
        return np.ones_like(x)

    def by_parameter(self, x: Array) -> Array:
        return np.ones((1, x.size))
