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

"""`FORMATS`: the table of all file formats; `Format`: the interface of a format.

A further format is a file in this folder and one line of `FORMATS`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Protocol, runtime_checkable

from ...record import Experiment
from ..bag.rosbag2 import Rosbag2
from ..table.read_options import ReadOptions
from .array_file_format import ArrayFileFormat
from .csv import Csv
from .gcs_array import GcsArrayFormat
from .hdf5 import Hdf5Arrays
from .mat import Mat
from .npy import NpyArrays
from .npz import Npz
from .tdms import TdmsArrays


class Format(Protocol):
    """One file format of experiments."""

    def recognises(self, path: Path) -> bool:
        """True if the file or folder looks like this format."""

    def read(self, path: Path, options: ReadOptions) -> Experiment:
        """The experiment at `path`, in SI units, with the findings as notices."""


@runtime_checkable
class WritableFormat(Format, Protocol):
    """A format that can also be written."""

    def write(self, experiment: Experiment, path: Path) -> None:
        """Write the experiment to `path`."""


@runtime_checkable
class TextFormat(Format, Protocol):
    """A format whose lines have to be passed one by one, so that several parts are read in one pass."""

    def read_parts(self, path: Path, parts: Sequence[ReadOptions]) -> list[Experiment]:
        """One experiment for each of `parts`, which differ in `rows`, `phases` and `initial_voltage` only."""


FORMATS: Mapping[str, Format] = {
    "npz": Npz(),
    "rosbag2": Rosbag2(),
    "mat": Mat(),
    "hdf5": ArrayFileFormat((".h5", ".hdf5", ".hdf"), "an HDF5 file", Hdf5Arrays),
    "npy": ArrayFileFormat((".npy",), "a NumPy array", NpyArrays),
    "tdms": ArrayFileFormat((".tdms",), "a LabVIEW TDMS file", TdmsArrays),
    "gcs_array": GcsArrayFormat(),
    "csv": Csv(),
}
"""Reader of every format by its name. The readers are tried in this order until one recognises a path."""
