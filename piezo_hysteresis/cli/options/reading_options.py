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

"""Options for reading a recording, shared by all subcommands with an experiment."""

from __future__ import annotations

import argparse
import re
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, TypeVar

from ... import recording
from ...errors import PiezoError, RecordError, RecordingError
from ...record import Experiment

T = TypeVar("T")


ROWS_BEFORE = 1 << 20
"""Largest number of rows in front of ``--rows`` that are read for the state of the stage."""


def add_arguments(parser: argparse.ArgumentParser, needs_experiment: bool = True) -> None:
    """Declare the experiment and the options for reading it."""
    parser.add_argument(
        "experiment",
        metavar="EXPERIMENT",
        nargs="+" if needs_experiment else "*",
        help="one or several recordings: bag, folder of .npz, .csv, .mat, …",
    )
    add_reading_group(parser)


def add_reading_group(parser: argparse.ArgumentParser) -> None:
    """Declare options for information that a file may lack."""
    group = parser.add_argument_group("options for reading, if the recording does not contain the information")
    group.add_argument(
        "--format",
        choices=tuple(recording.FORMATS),
        help="format of the file (default: inferred from the path)",
    )
    group.add_argument(
        "--axis",
        metavar="NS",
        help="namespace of one stage in a bag of several, e.g. /stage_x; several "
        "with commas between are one stage of several axes",
    )
    group.add_argument(
        "--column",
        metavar="CHANNEL=PLACE",
        action="append",
        default=[],
        help="column of a channel: its number from 1, its name, data[2] in a matrix, or /topic.field; e.g. "
        "displacement=5 (repeatable)",
    )
    group.add_argument(
        "--unit",
        metavar="CHANNEL=UNIT",
        action="append",
        default=[],
        help="unit of a channel, e.g. displacement=um, or its SI value, e.g. displacement=2e-6 for a sensor of 2 um/V; "
        "displacement=-um for a reversed sensor, displacement=- for one in the unit of the file (repeatable)",
    )
    group.add_argument("--sample-period", metavar="S", type=float, help="time between samples [s]")
    group.add_argument(
        "--initial-voltage",
        metavar="V",
        type=float,
        help="drive voltage at which the stage rested before every phase [V]",
    )
    group.add_argument(
        "--rows",
        metavar="FROM:TO",
        help="range of rows to read, as a Python slice; rows before it determine the state at its beginning",
    )
    group.add_argument(
        "--phase",
        metavar="[TIME=]NAME",
        action="append",
        default=[],
        help="name of the only phase, or start time [s] and name of each phase (repeatable)",
    )
    group.add_argument(
        "--include",
        metavar="NAME",
        action="append",
        default=[],
        help="phase to keep that is otherwise left out: idle, hold (repeatable)",
    )
    group.add_argument(
        "--average",
        metavar="N",
        type=int,
        help="average N samples into one while reading; default: no averaging up to 16.8 million samples, then the "
        "smallest N that is enough; 1 keeps all samples, up to 67 million",
    )
    group.add_argument(
        "--decimate",
        metavar="PHASE=N",
        action="append",
        default=[],
        help="average N samples into one in phases of that name (repeatable)",
    )


def read(args: argparse.Namespace, rows_before: int = ROWS_BEFORE) -> Experiment:
    """Read the experiment that the arguments name.

    Parameters
    ----------
    args : argparse.Namespace
        With the arguments of `add_arguments`.
    rows_before : int
        Largest number of rows in front of ``--rows`` that carry the state of the stage; 0 reads ``--rows`` alone.

    Raises
    ------
    RecordingError, RecordError
        If it cannot be read, or an option is invalid.
    """
    try:
        experiment = recording.read(*args.experiment, rows_before=rows_before, **keywords(args))
    except RecordError as error:
        raise RecordError(as_options(str(error))) from None
    except PiezoError as error:
        raise RecordingError(as_options(str(error))) from None
    return replace(experiment, notices=tuple(replace(n, message=as_options(n.message)) for n in experiment.notices))


def keywords(args: argparse.Namespace) -> dict[str, Any]:
    """The options as arguments of `recording.read`.

    Raises
    ------
    RecordingError
        If an option is invalid.
    """
    return {
        "format": args.format,
        "axis": args.axis,
        "columns": _pairs("--column", args.column, str),
        "units": _pairs("--unit", args.unit, str),
        "sample_period": args.sample_period,
        "initial_voltage": args.initial_voltage,
        "rows": _rows(args.rows),
        "phases": _phases(args.phase),
        "include": args.include,
        "average": args.average,
        "decimate": _pairs("--decimate", args.decimate, int) or None,
    }


_OPTIONS = {
    "axis": "--axis", "columns": "--column", "units": "--unit", "sample_period": "--sample-period",
    "initial_voltage": "--initial-voltage", "rows": "--rows", "phases": "--phase", "include": "--include",
    "average": "--average", "decimate": "--decimate", "format": "--format",
}  # fmt: skip
"""Arguments of `recording.read` to the options of the command line."""


def as_options(text: str) -> str:
    """A message that names arguments of `recording.read` in backquotes, with the options of the command line instead.

    >>> as_options("give `sample_period`, or name it by `columns`, e.g. voltage=2")
    'give --sample-period, or name it by --column, e.g. voltage=2'
    """
    return re.sub(r"`(\w+)`", lambda match: _OPTIONS.get(match[1], match[0]), text)


def _pairs(option: str, texts: Sequence[str], kind: Callable[[str], T]) -> dict[str, T]:
    pairs = {}
    for text in texts:
        name, equals, value = text.partition("=")
        try:
            pairs[name] = kind(value)
        except ValueError:
            equals = ""
        if not (name and equals and value):
            raise RecordingError(
                f"{option}: got '{text}', expected NAME={'N, a whole number' if kind is int else 'VALUE'}"
            )
    return pairs


def _rows(text: str | None) -> tuple[int | None, int | None] | None:
    if text is None:
        return None
    start, colon, stop = text.partition(":")
    try:
        if not colon:
            raise ValueError
        return (int(start) if start else None, int(stop) if stop else None)
    except ValueError:
        raise RecordingError(f"--rows: got '{text}', expected FROM:TO, e.g. 0:7000") from None


def _phases(texts: Sequence[str]) -> str | list[tuple[float, str]] | None:
    if not texts:
        return None
    if len(texts) == 1 and "=" not in texts[0]:
        return texts[0]
    try:
        return [(float(time), name) for time, _, name in (text.partition("=") for text in texts)]
    except ValueError:
        raise RecordingError(f"--phase: got {', '.join(texts)}, expected one NAME, or TIME=NAME for each") from None
