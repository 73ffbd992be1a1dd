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

"""Show where a model is wrong, name the missing effect, and measure the gap after adding it."""

from __future__ import annotations

import argparse

from ...discrepancy import Diagnosis, diagnose
from ...discrepancy.choice.live_diagnosis import LiveDiagnosis
from ...discrepancy.choice.time_to_decide import ERROR_RATE, LONGEST
from ...errors import IdentificationError, ParameterError
from ...home_path import in_home
from ...model import model_file
from ...report.figures.comparison import compare_diagnosis
from ...report.json_file import write_json
from ...report.page import page
from ...report.tables.answer_tables import correction_table, effect_table, gap_table, rejection_table, where_table
from ...report.verdict import answer_verdict
from ..options import reading_options
from ..options.destination import add_results, require_new_file, require_new_results
from ..options.stage_option import add_stage_arguments, diagnose_stage
from ..terminal import console, progress, severe_status, show, show_notices, usual_time


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Declare the subcommand."""
    parser = subparsers.add_parser("diagnose", description=__doc__)
    reading_options.add_arguments(parser, needs_experiment=False)
    parser.add_argument("--model", metavar="FILE", help="model file to start from (default: identify a model first)")
    parser.add_argument(
        "-o",
        "--output",
        metavar="FILE",
        help="file for the extended model; with --stage: folder for the recorded experiment",
    )
    parser.add_argument(
        "--correction",
        metavar="FILE",
        help="after the verdict unknown, write the model with a correction without a name to this file, if one is "
        "accepted",
    )
    parser.add_argument(
        "--time",
        type=float,
        default=float("inf"),
        metavar="S",
        help="time after which the search ends with the best answer so far [s] (default: no limit); the fit of the "
        "published model, the comparison with --model and the last fit are not limited",
    )
    parser.add_argument(
        "--explicit-step",
        action="store_true",
        help="for data of a simulation: subtract the error of the explicit step of Eq. (7)",
    )
    add_stage_arguments(parser)
    add_results(parser, report="write the HTML page, and its figures beside it", json="write the answer as JSON")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Diagnose, print and save; returns 0 for all three verdicts, or 1 if the data cannot be trusted.

    Raises
    ------
    PiezoError
        If the input is invalid, or the data do not determine a baseline.
    """
    live = None if args.stage is None else _of_stage(args)
    found = _of_recording(args) if live is None else live.found
    if found is None:
        raise IdentificationError("diagnose --stage: nothing was played, expected at least the first phases")
    path = ""
    if live is None and args.output is not None and found.model is not None:
        path = str(model_file.save(found.model, args.output))
    answer = found.answer(path)
    corrected = _save_corrected(found, args.correction)
    if live is not None:
        answer["live"] = live.answer()
    if args.json is not None:
        write_json(args.json, answer)
    if args.report is not None:
        with progress("report") as report_progress:
            drawn = page(compare_diagnosis(found), fit=found.fit, answer=answer, progress=report_progress)
        drawn.save(in_home(args.report))
    out = console()
    said = answer_verdict(answer)
    out.print(said.headline, style="bold")
    for sentence in said.sentences:
        out.print(sentence)
    out.print()
    show(
        effect_table(answer), correction_table(answer), where_table(answer), gap_table(answer), rejection_table(answer)
    )
    show_notices(found.experiment.notices)
    for written in (path, corrected, args.json, args.report):
        if written:
            out.print(f"wrote {written}")
    return severe_status(found.experiment.notices)


def _save_corrected(found: Diagnosis, path: str | None) -> str:
    """Write the model with its correction where one was accepted; returns the path, or nothing."""
    if path is None or found.correction is None or found.correction.model is None:
        return ""
    return str(model_file.save(found.correction.model, path))


def _of_stage(args: argparse.Namespace) -> LiveDiagnosis:
    if args.experiment or args.model is not None or args.explicit_step or args.time < float("inf"):
        raise ParameterError(
            "diagnose: got --stage beside a recording, a model, --time or --explicit-step, expected --stage alone"
        )
    for option, path in (("--report", args.report), ("--json", args.json), ("--correction", args.correction)):
        require_new_file(option, path, args.force)
    if args.correction is not None:
        model_file.require_name(args.correction)
    return diagnose_stage(args)


def _of_recording(args: argparse.Namespace) -> Diagnosis:
    if not args.experiment:
        raise ParameterError("diagnose: got no recording, expected one or several, or --stage FILE")
    if (args.error_rate, args.stage_time, args.seed) != (ERROR_RATE, LONGEST, 0):
        raise ParameterError("diagnose: got --error-rate, --stage-time or --seed without --stage")
    if not args.time > 0.0:
        raise ParameterError(f"diagnose: got --time {args.time:g}, expected more than 0 s")
    require_new_results(args)
    require_new_file("--correction", args.correction, args.force)
    for path in filter(None, (args.output, args.correction)):
        model_file.require_name(path)
    start = None if args.model is None else model_file.load(args.model)
    experiment = reading_options.read(args)
    with progress("diagnose", usual_time(experiment.size, "5 s", 2)) as report_progress:
        return diagnose(
            experiment,
            start,
            progress=report_progress,
            explicit_step=args.explicit_step,
            time_limit=args.time,
        )
