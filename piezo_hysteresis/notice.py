"""`Notice`: one finding about the quality of data."""

from __future__ import annotations

from dataclasses import dataclass

from .errors import printable


@dataclass(frozen=True, slots=True)
class Notice:
    """One finding about the quality of data. It is reported; the data are never changed silently.

    Parameters
    ----------
    kind : str
        Stable word: ``gap``, ``clipped``, ``non_finite``, ``duplicate``, ``not_at_rest``, ``units``, …
    message : str
        One plain line, made printable.
    phase : str
        Phase it was found in; empty for the whole experiment.
    severe : bool
        True where no verdict should rest on the data.
    """

    kind: str
    message: str
    phase: str = ""
    severe: bool = False

    def __post_init__(self) -> None:
        object.__setattr__(self, "message", printable(self.message))
