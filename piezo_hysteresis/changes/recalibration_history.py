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

"""`Recalibrations`: the recalibrations of a stage, as a table in a file."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path

import numpy as np

from ..effects import Arx, ExtraDelay
from ..errors import RecordingError
from ..model.model import Model
from ..online.change.score import GROUPS, loop_heights
from .group_fit import SURE, GroupFit
from .signatures import delay_of

FILE = "recalibrations.csv"
"""Name of the file."""


@dataclass(frozen=True, slots=True)
class RecalibratedNumber:
    """One recalibrated parameter of a model: one line of the history.

    Parameters
    ----------
    time : str
        Time at which the model was changed, ISO 8601, UTC.
    group, parameter, unit : str
        Group of the change watch, name of the parameter and its unit.
    old, new, low, high : float
        Value before and after, and the 95 % interval of the new value.
    statistic : float
        Statistic of the change watch over its threshold, at the request.
    residual_before, residual_after, residual_baseline : float
        RMS residual about its mean [m]: of the fitted samples with the old and the new model, and in the baseline.
    duration : float
        Duration of the fitted samples [s].
    model_before, model_after : str
        Hashes of the models.
    """

    time: str
    group: str
    parameter: str
    unit: str
    old: float
    new: float
    low: float
    high: float
    statistic: float
    residual_before: float
    residual_after: float
    residual_baseline: float
    duration: float
    model_before: str
    model_after: str


_TEXTS = ("time", "group", "parameter", "unit", "model_before", "model_after")
"""Columns that contain text."""
_COLUMNS = tuple(field.name for field in fields(RecalibratedNumber))
"""All columns, in order."""


def numbers_of(
    model: Model, old_offset: float, fit: GroupFit, time: str, statistic: float, hashes: tuple[str, str]
) -> tuple[RecalibratedNumber, ...]:
    """The parameters that a fit has changed.

    Parameters
    ----------
    model : Model
        Model before the fit.
    old_offset : float
        Sensor minus that model [m].
    fit : GroupFit
        Result of the fit.
    time : str
        Time of the change, ISO 8601, UTC.
    statistic : float
        Statistic of the change watch over its threshold.
    hashes : (str, str)
        Hashes of the model before and after.
    """
    found = []
    for group in fit.groups:
        k = GROUPS.index(group)
        change, half = float(fit.change[k]), SURE * float(fit.deviation[k])
        parameter, unit, old, per_change = _number(model, group, old_offset)
        low, high = sorted(old + per_change * c for c in (change - half, change + half))
        residuals = (fit.before, fit.after, fit.floor, fit.duration)
        found.append(
            RecalibratedNumber(
                time, group, parameter, unit, old, old + per_change * change, low, high, statistic, *residuals, *hashes
            )
        )
    return tuple(found)


def _number(model: Model, group: str, offset: float) -> tuple[str, str, float, float]:
    """Name, unit and value of the parameter that represents a group, and its change per unit change of the group."""
    if group == "gain":
        return "displacement_scale", "m", model.displacement_scale, model.displacement_scale
    if group == "loop":
        heights = loop_heights(model)
        if len(heights) == 1:
            ((name, value),) = heights.items()
            return name, model.row(name).unit, value, value
        return f"{model.hysteresis.name}, height", "1", 1.0, 1.0
    if group == "dynamics":
        delay, extra = f"{Arx.name}.delay", f"{ExtraDelay.name}.tau"
        if Arx.name in model and ExtraDelay.name not in model:
            return delay, "samples", model.values()[delay], 1.0 / model.sample_period
        return f"{delay} + {extra}" if Arx.name in model else extra, "s", delay_of(model), 1.0
    return "offset", "m", offset, 1.0


def write_numbers(numbers: Iterable[RecalibratedNumber]) -> str:
    """The table as CSV with a header."""
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(_COLUMNS)
    writer.writerows(asdict(number).values() for number in numbers)
    return stream.getvalue()


def read_numbers(text: str, source: str) -> tuple[RecalibratedNumber, ...]:
    """The table of a CSV text.

    Parameters
    ----------
    text : str
        Output of `write_numbers`.
    source : str
        Origin of the text, for messages.

    Raises
    ------
    RecordingError
        If the text is not such a table.
    """
    lines = list(csv.reader(io.StringIO(text)))
    if not lines or tuple(lines[0]) != _COLUMNS:
        raise RecordingError(f"{source}: got no history of recalibrations, expected the columns {', '.join(_COLUMNS)}")
    found = []
    for number, cells in enumerate(lines[1:], 2):
        row = dict(zip(_COLUMNS, cells, strict=False))
        try:
            values = {name: cell if name in _TEXTS else float(cell) for name, cell in row.items()}
            if (
                len(cells) != len(_COLUMNS)
                or not np.isfinite([v for v in values.values() if isinstance(v, float)]).all()
            ):
                raise ValueError
        except ValueError:
            raise RecordingError(
                f"{source}, line {number}: got {','.join(cells)}, expected {len(_COLUMNS)} values, finite numbers"
            ) from None
        found.append(RecalibratedNumber(**values))  # type: ignore[arg-type]
    return tuple(found)


class Recalibrations:
    """The history of a stage in a file.

    Parameters
    ----------
    folder : Path
        Folder of the file, which need not exist yet.

    Attributes
    ----------
    numbers : tuple of RecalibratedNumber
        Oldest first.

    Raises
    ------
    RecordingError
        If the file exists and is not a history.
    """

    def __init__(self, folder: Path) -> None:
        self.path = folder / FILE
        try:
            text = self.path.read_text(encoding="utf-8") if self.path.is_file() else write_numbers(())
        except (OSError, UnicodeDecodeError) as error:
            raise RecordingError(f"{self.path}: cannot be read ({error})") from None
        self.numbers = read_numbers(text, str(self.path))

    def add(self, numbers: Sequence[RecalibratedNumber]) -> None:
        """Add numbers and write the file atomically.

        Raises
        ------
        RecordingError
            If the file cannot be written; `numbers` contains the new numbers nevertheless.
        """
        self.numbers += tuple(numbers)
        partial = self.path.with_suffix(".partial")
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            partial.write_text(write_numbers(self.numbers), encoding="utf-8")
            partial.replace(self.path)
        except OSError as error:
            raise RecordingError(f"{self.path}: cannot be written ({error.strerror})") from None
