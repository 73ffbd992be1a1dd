"""`Format`: what every kind of recording can do."""

from __future__ import annotations

from pathlib import Path
from typing import Protocol, runtime_checkable

from ...record import Experiment
from ..table.read_options import ReadOptions


class Format(Protocol):
    """One way in which experiments lie on disk."""

    def recognises(self, path: Path) -> bool:
        """True if the file or folder looks like this format."""

    def read(self, path: Path, options: ReadOptions) -> Experiment:
        """The experiment at `path`, in SI units, with notices about what was found."""


@runtime_checkable
class WritableFormat(Format, Protocol):
    """A format that can also be written."""

    def write(self, experiment: Experiment, path: Path) -> None:
        """Write the experiment to `path`."""
