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

"""Compute the drive voltage that makes a stage follow a path, and the expected error.

Nothing moves. The command is written to a file, and the expected error and the reachable part of the path are printed.
Send the command with the driver node or with your own program.
"""

from __future__ import annotations

import argparse
import math
from pathlib import Path
from typing import Any

import numpy as np

from ...compensation import Limits, Plan, plan
from ...errors import ModelError, ParameterError, RecordingError
from ...home_path import in_home
from ...model import model_file
from ...recording.wanted_path import read_path
from ...recording.whole_file import whole_file
from ...report.json_file import write_json
from ...report.tables.plan_table import answer, notes, plan_table
from ..options.destination import add_results, require_new_results
from ..terminal import console, show

UNREACHABLE = "A part of the path cannot be reached."
"""Beginning of the last line after a path that cannot be followed."""
LONGEST_WAY = 1000.0
"""Longest way to the path or back [s], as that of the compensation node."""


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Declare the subcommand."""
    parser = subparsers.add_parser("compensate", description=__doc__)
    parser.add_argument("model", metavar="MODEL", help="model file")
    parser.add_argument("path", metavar="PATH", help="CSV (time_s,displacement_um) or NPZ with the wanted displacement")
    parser.add_argument(
        "-o", "--output", metavar="FILE", default="command.npz", help="file of the drive voltage (default: command.npz)"
    )
    parser.add_argument("--voltage-min", metavar="V", type=float, default=0.0, help="lowest drive voltage (default: 0)")
    parser.add_argument(
        "--voltage-max", metavar="V", type=float, default=10.0, help="highest drive voltage (default: 10)"
    )
    parser.add_argument(
        "--max-slew-rate", metavar="V/S", type=float, default=math.inf, help="steepest drive (default: no limit)"
    )
    parser.add_argument(
        "--rest-voltage", metavar="V", type=float, default=0.0, help="voltage at which the stage rests before the path"
    )
    parser.add_argument(
        "--approach",
        metavar="S",
        type=float,
        default=0.05,
        help="duration of the approach to the path [s], at least 200 samples (default: 0.05)",
    )
    parser.add_argument(
        "--way-back",
        metavar="S",
        type=float,
        default=0.05,
        help="duration of the way back to the rest voltage after the path [s]; 0: the command ends with the path "
        "(default: 0.05)",
    )
    parser.add_argument("--approximate", action="store_true", help="leave out effects that cannot be inverted")
    parser.add_argument(
        "--allow-partial", action="store_true", help="write the voltage even if a part of the path cannot be reached"
    )
    add_results(
        parser,
        figures="folder for the figure and its data",
        report="HTML page with the plan, the expected error and the figure",
        json="write the result as JSON",
    )
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Plan, print and save; returns 0, or 1 if a part of the path is not reachable.

    Raises
    ------
    PiezoError
        On a model or a path that cannot be read, or a chain that cannot be inverted.
    """
    require_new_results(args)
    _check_times(args)
    model = model_file.load(args.model)
    wanted, period = read_path(args.path)
    resampled = period is not None and abs(period - model.sample_period) > 1e-6 * model.sample_period
    if resampled and period is not None:
        if period < model.sample_period:
            raise ModelError(
                f"{args.path}: got a sample period of {period:g} s, expected {model.sample_period:g} s (the model's) "
                "or more"
            )
        count = 1 + int((wanted.size - 1) * period / model.sample_period * (1.0 + 1e-12))
        wanted = np.interp(model.sample_period * np.arange(count), period * np.arange(wanted.size), wanted)
    limits = Limits(args.voltage_min, args.voltage_max, args.max_slew_rate)
    found = plan(
        model,
        wanted,
        limits,
        start=model.at(model.sample_period).rest(args.rest_voltage),
        approach=args.approach,
        way_back=args.way_back,
        approximate=args.approximate,
    )
    if args.json is not None:
        write_json(args.json, answer(found))
    if args.figures is not None:
        _draw(found, in_home(args.figures))
    if args.report is not None:
        from ...report.plan_page import plan_page

        plan_page(found, model, args.path).save(in_home(args.report))
    show(plan_table(found))
    out = console()
    if resampled:
        out.print(f"note: the path was interpolated to the model's sample period, {model.sample_period:g} s")
    if period is None and wanted.size > 1:
        out.print(
            f"note: the path has no times; its rows are taken at the model's sample period, {model.sample_period:g} s"
        )
    for line in notes(found):
        out.print(line)
    if not found.reachability.is_whole and not args.allow_partial:
        out.print(f"{UNREACHABLE} No command was written; change the path, or write what is allowed: --allow-partial")
        return 1
    _save(found, in_home(args.output))
    out.print(f"wrote {args.output}")
    if not found.reachability.is_whole:
        out.print(UNREACHABLE)
        return 1
    return 0


def _check_times(args: argparse.Namespace) -> None:
    for option, value in (("--approach", args.approach), ("--way-back", args.way_back)):
        if not 0.0 <= value <= LONGEST_WAY:
            raise ParameterError(f"{option}: got {value:g} s, expected 0 to {LONGEST_WAY:g} s")
    if not math.isfinite(args.rest_voltage):
        raise ParameterError(f"--rest-voltage: got {args.rest_voltage:g} V, expected a finite voltage")


def _save(found: Plan, place: Path) -> None:
    arrays: dict[str, Any] = {
        "voltage": found.voltage,
        "sample_period": np.float64(found.sample_period),
        "expected_displacement": found.predicted,
        "wanted_displacement": found.wanted,
        "path_begin": np.int64(found.begin),
    }
    try:
        with whole_file(place) as draft, draft.open("wb") as file:
            np.savez(file, **arrays)
    except OSError as error:
        raise RecordingError(f"{place}: cannot be written ({error.strerror or error})") from None


def _draw(found: Plan, folder: Path) -> None:
    from ...report.figures.tracking import tracking

    tracking(found).save(folder)
