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

"""MATLAB files: version 5 to 7.2 read and written through scipy, 7.3 (HDF5) read through h5py."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from ...errors import RecordingError
from ...record import Experiment, Notice, Record
from ..checks.error_context import naming
from ..table.read_options import LABELS, ReadOptions
from ..whole_file import whole_file
from .hdf5 import Hdf5Arrays, is_hdf5
from .mat5 import Mat5Arrays
from .records_from_arrays import records_from_arrays

_STRUCT = "phase_"
"""Beginning of the names of the structures that hold phases."""


class Mat:
    """One struct per record, ``phase_01``, ``phase_02``, …, or the variables of a foreign file.

    Fields and variables are called as the channels (`voltage` [V], `displacement` [m], `time` [s], …) and labels
    (`phase`, `sample_period`, `continues`, …). `ReadOptions.columns` names others: ``"u"``,
    ``"data.position"`` for a field of a struct, ``"y[2]"`` for a column of a matrix, counted from 1 as in MATLAB. The
    signals of a dSPACE capture, struct arrays with the fields `Name` and `Data`, are called ``"run.Y.name"``.
    """

    def recognises(self, path: Path) -> bool:
        """True for the ending .mat."""
        return path.is_file() and path.suffix.lower() == ".mat"

    def read(self, path: Path, options: ReadOptions) -> Experiment:
        """The structs in order of their numbers, or the variables as one record."""
        with naming(path, "a MAT file"), (Hdf5Arrays if is_hdf5(path) else Mat5Arrays)(path) as variables:
            structs = sorted({name.partition(".")[0] for name in variables if re.match(_STRUCT + r"\d+\.", name)})
            records: list[Record] = []
            notices: list[Notice] = []
            for prefix in [""] if options.columns or not structs else [f"{struct}." for struct in structs]:
                parts, more_notices = records_from_arrays(variables, prefix, options, records)
                records += parts
                notices += more_notices
            return Experiment(tuple(records), str(path), tuple(notices))

    def write(self, experiment: Experiment, path: Path) -> None:
        """Write one struct per record, version 5.

        Raises
        ------
        RecordingError
            If the file exists or cannot be written.
        """
        from scipy import io  # slow to import, and only needed here

        structs = {}
        for number, record in enumerate(experiment, 1):
            fields: dict[str, Any] = {"voltage": record.voltage, "displacement": record.displacement}
            fields |= record.channels
            for name in LABELS:
                value = getattr(record, name, None)
                if value is not None:
                    fields[name] = value
            structs[f"{_STRUCT}{number:02d}"] = fields
        with naming(path, "a file that can be written"):
            if path.exists():
                raise RecordingError("exists already; choose another name")
            with whole_file(path) as draft:
                io.savemat(draft, structs, appendmat=False, oned_as="column")
