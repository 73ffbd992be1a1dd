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

"""Fit gain, offset, loop height and lag of an old model to new records of the same stage."""

from __future__ import annotations

import argparse

import numpy as np

from ...changes.moved_group import FULL
from ...changes.recalibration import recalibrate
from ...model import model_file
from ...report.json_file import write_json
from ...report.stage_verdict import can_be_trusted, stage_sentence
from ..options import reading_options
from ..options.destination import add_results, require_new_results
from ..terminal import console, show_notices


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Declare the subcommand."""
    parser = subparsers.add_parser("recalibrate", description=__doc__)
    parser.add_argument("model", metavar="MODEL", help="model file of the same stage")
    reading_options.add_arguments(parser)
    parser.add_argument("-o", "--output", metavar="FILE", default="model.yaml", help="model file (default: model.yaml)")
    add_results(parser, json="write the result as JSON")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Fit the four numbers, print and save; returns 0, or 1 where model or data cannot be trusted.

    Raises
    ------
    PiezoError
        If the input is invalid, or the stage does not move in the records.
    """
    require_new_results(args)
    model_file.require_name(args.output)
    model = model_file.load(args.model)
    experiment = reading_options.read(args)
    found = recalibrate(model, experiment)
    path = model_file.save(found.model, args.output)
    if args.json is not None:
        numbers = ("gain", "loop_height", "lag", "offset", "before", "after", "largest", "known")
        units = ("relative", "relative", "s", "m", *4 * ("percent_of_range",))
        rows = {f"{n}_{u}": getattr(found, n) for n, u in zip(numbers, units, strict=True)}
        intervals = {f"{n}_interval_95": ends for n, ends in found.intervals_95.items() if np.isfinite(ends).all()}
        write_json(args.json, {"schema": 1, "model": str(path), **rows, **intervals})
    out = console()
    out.print("Changes of the model, and its new offset:")
    for name, size, factor, unit in (
        ("gain", found.gain, 100.0, "%"),
        ("loop height", found.loop_height, 100.0, "%"),
        ("lag", found.lag, 1e6, "µs"),
    ):
        ends = found.intervals_95.get(name.replace(" ", "_"))
        told = ""
        if ends and np.isfinite(ends).all():
            told = f" (95 %: {factor * ends[0]:+.3g} to {factor * ends[1]:+.3g} {unit})"
        elif ends:
            told = " (without an interval, because the records have too few parts)"
        out.print(f"{name:<12} {factor * size:+.3f} {unit}{told}")
    out.print(f"offset       {1e9 * found.offset:.4g} nm")
    out.print(f"The free-run error was {found.before:.3g} % of the range before and is {found.after:.3g} % after.")
    show_notices((*experiment.notices, *found.notices))
    out.print(f"wrote {path}")
    severe = sum(notice.severe for notice in experiment.notices)
    caveat = f" Severe findings in the data make this doubtful: {severe}, see above." if severe else ""
    cause = f": something else has changed, or the drive shows what the model misses; {FULL}."
    out.print(f"Verdict: {stage_sentence(found.check, found.after, cause)}{caveat}", style="bold")
    return 0 if can_be_trusted(found.check, found.after) and not severe else 1
