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

"""Write one self-contained page that compares an experiment with models."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from ...errors import ParameterError, RecordingError, counted
from ...home_path import in_home
from ...identification.free_run_error import free_per_record
from ...identification.records.comparable import comparable
from ...model import model_file
from ...report.figures.comparison import compare
from ...report.json_file import read_json
from ...report.page import page
from ...report.tables.answer_tables import correction_table, effect_table, gap_table, rejection_table, where_table
from ...report.verdict import answer_verdict
from ..options import reading_options
from ..options.destination import add_force, require_new_results
from ..terminal import console, progress


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Declare the subcommand."""
    parser = subparsers.add_parser("report", description=__doc__)
    reading_options.add_arguments(parser)
    parser.add_argument(
        "-o", "--output", metavar="FILE", default="report.html", help="HTML page to write (default: report.html)"
    )
    parser.add_argument(
        "--model",
        metavar="[LABEL=]FILE",
        action="append",
        default=[],
        help="model file; the last one is reported, the first one is shown for comparison (repeatable)",
    )
    parser.add_argument("--answer", metavar="FILE", help="file written by piezo diagnose --json")
    parser.add_argument(
        "--one-zero", action="store_true", help="one sensor zero for all phases instead of one for each"
    )
    parser.add_argument("--title", default="Piezo stage: model against measurement", help="heading of the page")
    add_force(parser)
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Draw and write the page; returns 0.

    Raises
    ------
    PiezoError
        On files that cannot be read or written.
    """
    require_new_results(args)
    models = {}
    for text in args.model:
        label, equals, path = text.rpartition("=")
        label = label if equals else Path(path).stem
        if label in models:
            raise ParameterError(f"--model: got two models called '{label}', expected LABEL=FILE with different labels")
        models[label] = model_file.load(path)
    answer = None if args.answer is None else _answer(args.answer)
    experiment = reading_options.read(args)
    if models:
        prepared, notices = comparable(experiment)
        experiment = prepared.noting(*notices)
    nuisances = (
        None if args.one_zero else {label: free_per_record(model, offset=True) for label, model in models.items()}
    )
    with progress("report") as report_progress:
        drawn = page(compare(experiment, models, nuisances), answer=answer, title=args.title, progress=report_progress)
    path = in_home(args.output)
    drawn.save(path)
    console().print(f"wrote {path} and {counted(len(drawn.drawings), 'figure')} beside it")
    return 0


def _answer(path: str) -> dict[str, Any]:
    """The answer of a diagnosis, whose parts are tried before anything is drawn."""
    answer = read_json(path)
    if missing := [key for key in ("schema", "verdict", "effects") if key not in answer]:
        raise RecordingError(f"{path}: got no '{missing[0]}', expected the answer of `piezo diagnose --json`")
    try:
        answer_verdict(answer)
        for table in (effect_table, correction_table, where_table, gap_table, rejection_table):
            table(answer)
    except (AttributeError, KeyError, TypeError, ValueError) as error:
        reason = f"{type(error).__name__}: {error}"
        raise RecordingError(f"{path}: damaged ({reason}), expected the answer of `piezo diagnose --json`") from None
    return answer
