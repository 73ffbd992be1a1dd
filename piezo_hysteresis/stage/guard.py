"""`guarded`: if its device fails, a stage goes to its safe voltage and reports whether this succeeded."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from ..errors import DeviceError, StageError


@contextmanager
def guarded(retreat: Callable[[], None], reached: Callable[[], str], unknown: Callable[[], str]) -> Iterator[None]:
    """Bring the stage to its safe voltage when the device fails within the block.

    Parameters
    ----------
    retreat : callable
        Goes to the safe voltage; raises DeviceError if that fails, too.
    reached, unknown : callable
        Return the end of the message: where the stage is after the retreat, or what is known if the retreat failed.

    Raises
    ------
    StageError
        In place of the DeviceError; the message says where the stage is.
    """
    try:
        yield
    except DeviceError as error:
        try:
            retreat()
            end = reached()
        except DeviceError:
            end = unknown()
        raise StageError(f"{error}; {end}") from None
