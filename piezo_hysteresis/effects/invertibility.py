"""`Invertibility`: whether an effect has an inverse, for `compensation`."""

from __future__ import annotations

from enum import StrEnum


class Invertibility(StrEnum):
    """Whether a wanted output of an effect can be turned into the input that gives it."""

    EXACT = "exact"
    """Exact up to rounding, wherever the wanted output is reachable."""
    APPROXIMATE = "approximate"
    """With an error that `Inverse` states."""
    NOT_NEEDED = "not needed"
    """The effect is not on the way from the drive to the displacement, and nobody knows its course beforehand."""
    IMPOSSIBLE = "impossible"
    """No inverse sample by sample is known."""
