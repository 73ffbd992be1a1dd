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

"""`ArrayAnswer`: the table of numbers with a header that ``DRR?`` and ``GWD?`` answer."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ...gcs_header import END, gcs_header, gcs_separator
from ..description import Samples
from .connection import Gcs2Error


@dataclass(frozen=True, eq=False, slots=True)
class ArrayAnswer:
    """A GCS array as a controller answers it; saved ones are read by `piezo_hysteresis.recording`.

    Parameters
    ----------
    header : dict
        Keys of the lines ``# KEY = value`` in capitals, with their values as text.
    values : (rows, columns) ndarray
        The numbers, finite.
    """

    header: dict[str, str]
    values: Samples

    @classmethod
    def parse(cls, lines: list[str], rows: int, columns: int) -> ArrayAnswer:
        """Read the lines of an answer.

        Raises
        ------
        Gcs2Error
            Without a header, with another number of rows or columns, or with a row that holds no finite numbers.
        """
        found = gcs_header(lines)
        if found is None:
            raise Gcs2Error(f"got '{' '.join(lines)[:60]}', expected a header that ends with '# {END}'")
        header, first = found
        if len(lines) - first != rows:
            raise Gcs2Error(f"got {len(lines) - first} rows, expected {rows}")
        separator = gcs_separator(header)
        values = np.empty((rows, columns))
        for row, line in enumerate(lines[first:]):
            cells = line.split(separator)
            try:
                values[row] = [float(cell) for cell in cells]
                sound = len(cells) == columns and "_" not in line and bool(np.isfinite(values[row]).all())
            except ValueError:
                sound = False
            if not sound:
                raise Gcs2Error(f"row {row + 1} of {rows} is '{line[:60]}', expected {columns} finite numbers")
        return cls(header, values)

    @property
    def sample_time(self) -> float | None:
        """Time between rows [s]; None if the header gives no valid one."""
        try:
            period = float(self.header["SAMPLE_TIME"])
        except (KeyError, ValueError):
            return None
        return period if 0 < period < math.inf else None
