"""`ArrayFileFormat`: files of other software that hold the channels of one record as arrays under names."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from ...record import Experiment
from ..checks.error_context import naming
from ..table.read_options import ReadOptions
from .named_arrays import NamedArrays
from .records_from_arrays import records_from_arrays


class ArrayFileFormat:
    """One record from the arrays of a file; `ReadOptions.columns` says which is which where their names do not.

    Parameters
    ----------
    endings : tuple of str
        Of the names of such files.
    expected : str
        What such a file is, in messages.
    opened : callable
        From the path to the arrays by name.
    """

    def __init__(self, endings: tuple[str, ...], expected: str, opened: Callable[[Path], NamedArrays]) -> None:
        self._endings, self._expected, self._opened = endings, expected, opened

    def recognises(self, path: Path) -> bool:
        """True for the endings."""
        return path.is_file() and path.suffix.lower() in self._endings

    def read(self, path: Path, options: ReadOptions) -> Experiment:
        """The arrays as phases named by what the drive looks like, unless `ReadOptions.phases` says otherwise."""
        with naming(path, self._expected), self._opened(path) as arrays:
            records, notices = records_from_arrays(arrays, "", options)
            return Experiment(tuple(records), str(path), tuple(notices))
