# Copyright 2026 piezo_hysteresis maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

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
    """One record from the arrays of a file; `ReadOptions.columns` assigns the channels where their names are not clear.

    Parameters
    ----------
    endings : tuple of str
        Of the names of such files.
    expected : str
        Description of such a file for messages.
    opened : callable
        Function from the path to the arrays by name.
    """

    def __init__(self, endings: tuple[str, ...], expected: str, opened: Callable[[Path], NamedArrays]) -> None:
        self._endings, self._expected, self._opened = endings, expected, opened

    def recognises(self, path: Path) -> bool:
        """True for the endings."""
        return path.is_file() and path.suffix.lower() in self._endings

    def read(self, path: Path, options: ReadOptions) -> Experiment:
        """The arrays as phases, which are named by the shape of the drive unless `ReadOptions.phases` names them."""
        with naming(path, self._expected), self._opened(path) as arrays:
            records, notices = records_from_arrays(arrays, "", options)
            return Experiment(tuple(records), str(path), tuple(notices))
