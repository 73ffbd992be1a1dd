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

"""`piezo identify` and `piezo validate` for records of several axes."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ...errors import IdentificationError, ModelError, ParameterError
from ...home_path import in_home
from ...identification.identify_axes import LENGTH, AxisError, axes_errors, identify_axes
from ...identification.records.roles import HELD_OUT
from ...model import axes_file
from ...model.axes_samples import names
from ...record import Experiment, Record
from ...report.json_file import write_json
from ...report.tables.table import Table
from ...report.words import describes, error_sentence
from ..options.destination import require_new_results
from ..terminal import console, show, show_notices

DEFAULT = "model.npz"
"""Name of a model of several axes, unless another is given."""


def identify(experiment: Experiment, args: argparse.Namespace) -> int:
    """Fit a model of several axes, print its errors and save it; returns 0, or 1 where it cannot be trusted.

    Raises
    ------
    PiezoError
        On an output that does not end in .npz, an option for one axis, or data that do not determine the model.
    """
    if args.output is None:
        args.output = DEFAULT
        require_new_results(args)
    path = in_home(args.output)
    first = experiment[0]
    channels = ", ".join((*names(first, "voltage"), *names(first, "displacement")))
    if path.suffix != ".npz":
        raise ModelError(
            f"{path}: a model of several axes ({channels}) is an NPZ file; give -o a name that ends in .npz"
        )
    for option, is_given in (
        ("--hysteresis or --published", args.hysteresis is not None),
        ("--orders", args.orders is not None),
        ("--choose-orders", args.choose_orders),
        ("--no-memory", args.no_memory),
    ):
        if is_given:
            raise ParameterError(
                f"{option}: got records of several axes ({channels}), expected one axis; leave the option out, because "
                "a model of several axes always has responses of --taps samples and a set of plays"
            )
    if args.taps is not None and args.taps < 1:
        raise ParameterError(f"--taps: got {args.taps}, expected a whole number of samples, 1 or more")
    judges = experiment.named(*(HELD_OUT if args.held_out is None else args.held_out))
    fitted = [record for record in experiment if record not in judges]
    if not fitted:
        raise IdentificationError("every phase is held out, expected at least one to fit")
    model = identify_axes(fitted, length=LENGTH if args.taps is None else args.taps)
    errors = axes_errors(model, judges or fitted)
    axes_file.save(replace(model, free_run_error=_error_of_each_axis(errors)), path)
    _show(errors, "not fitted" if judges else "fitted", args.json)
    show_notices(experiment.notices)
    console().print(f"wrote {path}")
    return _verdict(errors, experiment)


def validate(experiment: Experiment, args: argparse.Namespace) -> int:
    """Print the free-run errors of a model of several axes; returns 0, or 1 where model or data cannot be trusted.

    Raises
    ------
    PiezoError
        On an option for one axis, or if the model or the records cannot be used, or do not fit each other.
    """
    for option, is_given in (("--figures", args.figures is not None), ("--one-zero", args.one_zero)):
        if is_given:
            raise ParameterError(
                f"{option}: got a model of several axes, expected a model of one axis; leave the option out"
            )
    records: Sequence[Record] = experiment.records
    errors = axes_errors(axes_file.load(args.model), records)
    _show(errors, "", args.json)
    show_notices(experiment.notices)
    return _verdict(errors, experiment)


def _error_of_each_axis(errors: Sequence[AxisError]) -> NDArray[np.float64]:
    """Free-run error of every displacement over all records, shape (p,) [m]."""
    axes = dict.fromkeys(error.displacement for error in errors)
    return np.sqrt([np.mean([e.rms**2 for e in errors if e.displacement == axis]) for axis in axes])


def _verdict(errors: Sequence[AxisError], experiment: Experiment) -> int:
    """Print the result in one sentence, from the largest error; returns the exit status."""
    largest = max(error.percent for error in errors)
    severe = sum(notice.severe for notice in experiment.notices)
    caveat = f" Severe findings in the data make this doubtful: {severe}, see above." if severe else ""
    console().print(f"Verdict, from the largest error: {error_sentence(largest)}{caveat}", style="bold")
    return 0 if describes(largest) and not severe else 1


def _show(errors: Sequence[AxisError], data: str, json: str | None) -> None:
    if json is not None:
        entries = [
            {"phase": e.phase, "displacement": e.displacement, "rms_m": e.rms, "percent_of_range": e.percent}
            for e in errors
        ]
        write_json(json, {"schema": 1, "errors": entries})
    rows = tuple((e.phase, e.displacement, f"{e.percent:.3f}", f"{1e9 * e.rms:.1f}") for e in errors)
    note = (
        "Predicted from the voltages alone; one sensor zero free per phase and displacement. The range of an axis is "
        "that over all phases."
    )
    title = f"Free-run error of several axes{', data ' + data if data else ''}"
    show(Table(title, ("phase", "displacement", "% of range", "nm"), rows, note, frozenset({2, 3})))
