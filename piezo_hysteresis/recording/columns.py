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

"""Converts experiments to columns of arrays and back, for a pandas DataFrame or an xarray Dataset.

>>> table = pandas.DataFrame(to_columns(experiment))          # doctest: +SKIP
>>> experiment = from_columns(table[table.time_s < 2.0])      # doctest: +SKIP

Neither library is imported, because a DataFrame, a Dataset and a dict all give their columns by name.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from ..channel_mapping import QUANTITIES, quantity_of
from ..errors import RecordingError
from ..record import Experiment, Record
from .checks.error_context import naming
from .table.read_options import LABELS, ReadOptions, is_channel
from .table.table import resolve, table_records


class TableColumns(Protocol):
    """Columns by name: a mapping, a DataFrame, a Dataset."""

    def __iter__(self) -> Any:
        """Names of the columns."""

    def __getitem__(self, name: Any, /) -> Any:
        """One column, in any type that `numpy.asarray` accepts."""


def to_columns(given: Record | Iterable[Record]) -> dict[str, NDArray[Any]]:
    """Samples of all records one after the other, with the titles and units that `from_columns` reads.

    Parameters
    ----------
    given : Record or iterable of Record
        An experiment, or a part of one.

    Returns
    -------
    dict of str to (n,) ndarray
        ``time_s``, ``voltage_V``, ``displacement_m``, the further channels that all records have, ``phase`` and
        ``record``, the number of the record from 1.
    """
    records = [given] if isinstance(given, Record) else list(given)
    if not records:
        raise RecordingError("to_columns: got no record, expected at least one")
    found: dict[str, NDArray[Any]] = {
        "time_s": np.concatenate([r.time for r in records]),
        "voltage_V": np.concatenate([r.voltage for r in records]),
        "displacement_m": np.concatenate([r.displacement for r in records]),
    }
    for name in records[0].channels:
        if all(name in r.channels for r in records):
            found[f"{name}_{QUANTITIES[quantity_of(name) or name]}"] = np.concatenate(
                [r.channels[name] for r in records]
            )
    sizes = [r.size for r in records]
    found["phase"] = np.repeat(np.array([r.phase for r in records]), sizes)
    found["record"] = np.repeat(np.arange(1, len(records) + 1), sizes)
    return found


def experiment_from(columns: TableColumns, options: ReadOptions) -> Experiment:
    """The records of a table in memory, which `from_columns` checks."""
    with naming(Path("columns"), "columns of equal length"):
        titles = [str(name) for name in columns]
        arrays = [np.asarray(columns[name]).ravel() for name in columns]
        if len({values.size for values in arrays}) != 1 or arrays[0].size == 0:
            sizes = ", ".join(f"{title} {values.size}" for title, values in zip(titles, arrays, strict=True))
            raise RecordingError(f"got {sizes or 'no column'}, expected columns of one length")
        found = resolve(titles, len(titles), options)
        channels = {
            name: options.in_si(name, np.asarray(arrays[at], dtype=float), unit)
            for name, (at, unit) in found.columns.items()
            if is_channel(name)
        }
        words = {name: arrays[at].astype(str) for name, (at, _) in found.columns.items() if name in LABELS}
        marks = _marks(words)
        records, notices = table_records(channels, marks, options)
        return Experiment(tuple(records), "columns", (*notices, *found.notices))


def _marks(words: dict[str, NDArray[Any]]) -> list[tuple[int, dict[str, str]]]:
    """First row and labels of every run of rows with the same labels."""
    if not words:
        return []
    size = next(iter(words.values())).size
    changed = np.zeros(size, dtype=bool)
    changed[0] = True
    for values in words.values():
        changed[1:] |= values[1:] != values[:-1]
    return [(int(row), {name: str(v[row]) for name, v in words.items()}) for row in np.flatnonzero(changed)]
