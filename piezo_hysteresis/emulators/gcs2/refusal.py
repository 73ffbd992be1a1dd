"""`Refusal`: a command that an emulated controller does not carry out."""

from __future__ import annotations


class Refusal(Exception):  # noqa: N818 - it is no error of the emulator
    """Ends a command; its number waits for ``ERR?``.

    Parameters
    ----------
    number : int
        Error number.
    """

    def __init__(self, number: int) -> None:
        super().__init__(number)
        self.number = number
