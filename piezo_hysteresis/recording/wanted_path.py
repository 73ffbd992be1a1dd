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

"""`read_path`: reads a wanted displacement from CSV or NPZ."""

from __future__ import annotations

import csv
import zipfile
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..errors import RecordingError
from ..home_path import in_home
from ..yaml_file import read_regular_file
from .table.column_inference import inferred_columns, named_column, unit_in
from .table.dialect import decoded
from .table.units import si_factor

Array = NDArray[np.float64]

JITTER = 1e-3
"""Largest deviation of a time from its nominal value, in sample periods."""


def read_path(path: str | Path) -> tuple[Array, float | None]:
    """Displacement (n,) [m] and its sample period [s]; None where the file holds no times.

    Parameters
    ----------
    path : str or pathlib.Path
        CSV with a header, e.g. ``time_s,displacement_um``, or NPZ with the keys ``displacement`` [m] and optionally
        ``sample_period`` [s].

    Raises
    ------
    RecordingError
        If there is no such file, no displacement in it, several columns without times, or times that are not even.
    """
    place = in_home(path)
    try:
        return _from_npz(place) if place.suffix == ".npz" else _from_csv(place)
    except OSError as error:
        if isinstance(error, RecordingError):
            raise
        raise RecordingError(f"{place}: {error.strerror or error}, expected a path as CSV or NPZ") from None


def _from_npz(place: Path) -> tuple[Array, float | None]:
    try:
        read_regular_file(place, 1)
        with place.open("rb") as file, zipfile.ZipFile(file):  # np.load takes other files for pickled objects
            pass
        with np.load(place, allow_pickle=False) as held:
            if "displacement" not in held:
                raise RecordingError(f"{place}: got {', '.join(held) or 'nothing'}, expected a key 'displacement' [m]")
            period = float(held["sample_period"]) if "sample_period" in held else None
            if period is not None and not 0.0 < period < np.inf:
                raise RecordingError(f"{place}: got a sample_period of {period:g} s, expected a positive time")
            return _checked(place, np.asarray(held["displacement"], dtype=np.float64)), period
    except OSError:
        raise
    except Exception as error:  # zipfile, zlib and numpy raise errors of many kinds on a damaged file
        raise RecordingError(f"{place}: no NPZ file that can be read ({error}), expected numbers") from None


def _from_csv(place: Path) -> tuple[Array, float | None]:
    try:
        lines = decoded(read_regular_file(place)).splitlines()
        rows = [row for row in csv.reader(lines) if row and not row[0].startswith("#")]
    except csv.Error as error:
        raise RecordingError(f"{place}: no CSV that can be read ({error})") from None
    titles = [named_column(title) for title in rows[0]] if rows else []
    at = {channel: k for k, (channel, _) in enumerate(titles)}
    if "displacement" not in at:
        raise RecordingError(
            f"{place}: got the columns {', '.join(rows[0]) if rows else 'none'}, "
            "expected a header with a displacement and its unit, e.g. time_s,displacement_um"
        )
    if "time" not in at and len(titles) > 1:  # rows without times are taken at the model's rate, often far too fast
        found = inferred_columns(rows[0], (at["displacement"],), ("time",))
        if "time" not in found:
            raise RecordingError(
                f"{place}: got the columns {', '.join(rows[0])}, expected one for the time, e.g. time_s; name it, or "
                "give the displacement alone for rows at the model's sample period"
            )
        at["time"] = found["time"]
        titles[at["time"]] = ("time", unit_in(rows[0][at["time"]], "time"))

    def column(channel: str) -> Array:
        k = at[channel]
        factor = si_factor(channel, titles[k][1] or {"time": "s", "displacement": "m"}[channel])
        try:
            return factor * np.array([float(row[k]) for row in rows[1:]])
        except (ValueError, IndexError):
            raise RecordingError(f"{place}: column '{rows[0][k]}' contains cells that are not numbers") from None

    wanted = _checked(place, column("displacement"))
    if "time" not in at or wanted.size < 2:
        return wanted, None
    time = column("time")
    period = float(time[-1] - time[0]) / (time.size - 1)
    off = np.abs(time - time[0] - period * np.arange(time.size))
    if not period > 0.0 or not (off <= JITTER * period + 1e-12 * abs(time[-1])).all():
        raise RecordingError(f"{place}: the times are not evenly spaced; expected one sample period for the whole path")
    return wanted, period


def _checked(place: Path, wanted: Array) -> Array:
    if wanted.ndim != 1 or wanted.size == 0 or not np.isfinite(wanted).all():
        raise RecordingError(f"{place}: got {wanted.size} values of displacement, expected one row of finite numbers")
    return wanted
