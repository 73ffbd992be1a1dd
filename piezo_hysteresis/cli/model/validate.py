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

"""Show how well a model predicts an experiment in free run, and whether the residual depends on the drive."""

from __future__ import annotations

import argparse
from dataclasses import asdict
from pathlib import Path
from typing import Any

from ...errors import RecordError
from ...home_path import in_home
from ...identification.free_run_error import Error, Errors, free_per_record
from ...identification.identified_range import outside
from ...identification.records.comparable import comparable
from ...identification.stage_check import check_stage
from ...identification.structure.state_at_rest import begun_as_shown, rest_notices
from ...model import model_file
from ...model.model import Model
from ...record import CONDITIONING, Experiment, Notice
from ...report.correlation import CAPTION, correlate
from ...report.figures.comparison import ModelComparison, compare
from ...report.json_file import write_json
from ...report.stage_verdict import can_be_trusted, stage_sentence
from ...report.tables.error_table import error_table, frequency_table
from ...report.tables.table import Table
from ...report.verdict import floor_sentence, is_at_floor
from ...report.words import describes
from ..options import reading_options
from ..options.destination import add_results, require_new_results
from ..terminal import console, show, show_notices
from . import several_axes


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Declare the subcommand."""
    parser = subparsers.add_parser("validate", description=__doc__)
    parser.add_argument("model", metavar="MODEL", help="model file; .npz for several axes")
    reading_options.add_arguments(parser)
    parser.add_argument(
        "--one-zero", action="store_true", help="one sensor zero for all phases instead of one for each"
    )
    add_results(parser, figures="folder for the figures and their data", json="write the result as JSON")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Print the errors and the residual tests; returns 0, or 1 where model or data cannot be trusted.

    Raises
    ------
    PiezoError
        On a model or an experiment that cannot be read, or that do not fit each other.
    """
    require_new_results(args)
    if Path(args.model).suffix == ".npz":
        return several_axes.validate(reading_options.read(args), args)
    model = model_file.load(args.model)
    experiment, conditioned = comparable(reading_options.read(args))
    nuisances = None if args.one_zero else {"error": free_per_record(model, offset=True)}
    comparison = compare(experiment, {"error": model}, nuisances)
    now = comparison.errors["error"]
    tests, check = _tests(experiment, now), check_stage(model, experiment.records)
    beyond = outside(model, experiment)
    left = _left(tests)
    if describes(now.percent) and not ((left or not check.is_as_good) and is_at_floor(comparison, now)):
        left = f" {floor_sentence(comparison, now)}{left}"
    verdict = f"{stage_sentence(check, now.percent, _cause(bool(beyond)))}{left}{_caveats(experiment)}"
    severe = any(notice.severe for notice in (*experiment.notices, *conditioned))
    trusted = can_be_trusted(check, now.percent) and not severe
    other_state = () if is_at_floor(comparison, now) else _other_state(model, experiment)
    notices = (*experiment.notices, *conditioned, *beyond, *other_state)
    if args.json is not None:
        said = {"verdict_text": verdict, "trusted": trusted, "notices": [asdict(notice) for notice in notices]}
        write_json(args.json, {**answer(comparison, now, tests), **said})
    if args.figures is not None:
        _draw(comparison, in_home(args.figures))
    show(error_table(comparison), frequency_table(comparison), _test_table(tests))
    show_notices(notices)
    if args.figures is not None:
        console().print(f"wrote figures to {args.figures}")
    console().print(f"Verdict: {verdict}", style="bold")
    return 0 if trusted else 1


def _left(tests: list[dict[str, Any]]) -> str:
    """What the residual tests say about the model."""
    decided = [t for t in tests if t["decides"]]
    dependent = sum(not t["independent_of_drive"] for t in decided)
    if not dependent:
        return ""
    return (
        f" A part of the residual depends on the drive in {dependent} of the {len(decided)} phases that decide this, "
        "so that the model can be improved; see piezo diagnose."
    )


def _cause(leaves_range: bool) -> str:
    """Causes of an error that is larger than the known one; a drive outside the identified range comes first."""
    first = ": the"
    if leaves_range:
        first = ". The drive leaves the range that the model was identified on, which may be the cause. Otherwise the"
    return f"{first} stage has changed, or the drive shows what the model misses; see piezo diagnose --model."


def _other_state(model: Model, experiment: Experiment) -> tuple[Notice, ...]:
    """Whether the model predicts the records much better in the state of a stage that was driven before them."""
    driven = begun_as_shown(model, experiment.records)
    if driven is model:
        return ()
    (notice,), left = rest_notices(driven), check_stage(driven, experiment.records).percent
    message = f"{notice.message}; begun in that state, the model leaves {left:.3g} % of the range"
    return (Notice(notice.kind, message),)


def _caveats(experiment: Experiment) -> str:
    severe = list(dict.fromkeys(n.phase or "all" for n in experiment.notices if n.severe))
    unknown = [r.phase for r in experiment if r.truncated and r.phase != CONDITIONING]
    message = f" Severe findings in the data make this doubtful: {', '.join(severe)}." if severe else ""
    return message + (f" The state at the start is unknown: {', '.join(unknown)}." if unknown else "")


def answer(comparison: ModelComparison, now: Errors, tests: list[dict[str, Any]]) -> dict[str, Any]:
    """The result for machines."""
    return {
        "schema": 1,
        "range_m": now.range,
        "zero_m": now.zero,
        "rms_m": now.rms,
        "percent_of_range": now.percent,
        "phases": [_phase(comparison, row) for row in now.judged],  # without the part before the first full loop
        "phases_not_judged": [_phase(comparison, row) for row in now.rows if row not in now.judged],
        "percent_of_range_by_frequency": {f"{f:g}": percent for f, percent in now.by_frequency.items()},
        "residual_tests": tests,
    }


def _phase(comparison: ModelComparison, row: Error) -> dict[str, Any]:
    return {
        "phase": row.phase,
        "frequency_hz": row.frequency,
        "samples": row.size,
        "rms_m": row.rms,
        "percent_of_range": row.percent,
        "largest_m": row.largest,
        "fit_percent": row.fit,
        "floor_m": float(comparison.floors[row.index]),
    }


def _tests(experiment: Experiment, now: Errors) -> list[dict[str, Any]]:
    tests = []
    for row in now.judged:  # without the part before the first full loop
        record = experiment[row.index]
        try:
            found = correlate(now.residuals[row.index], record.voltage, record.sample_period)
        except RecordError:
            continue
        tests.append(
            {
                "phase": record.phase,
                "auto": float(abs(found.auto[1:]).max()),
                "auto_bound": float(found.auto_bound),
                "white": found.is_white,
                "cross": float(abs(found.cross).max()),
                "cross_bound": found.cross_bound,
                "decides": found.decides,
                "independent_of_drive": found.is_independent,
            }
        )
    return tests


def _test_table(tests: list[dict[str, Any]]) -> Table:
    rows = tuple(
        (
            t["phase"],
            f"{t['auto']:.3f}",
            f"{t['auto_bound']:.3f}",
            f"{t['cross']:.3f}",
            f"{t['cross_bound']:.3f}",
            "undecided" if not t["decides"] else "passed" if t["independent_of_drive"] else "depends on the drive",
        )
        for t in tests
    )
    header = ("phase", "auto", "bound", "cross", "bound", "verdict")
    title = "Residual tests: largest correlation over 50 lags, 99 % bounds"
    return Table(title, header, rows, CAPTION, frozenset(range(1, 5)))


def _draw(comparison: ModelComparison, folder: Path) -> None:
    from ...report.figures.diagnosis.gap import gap
    from ...report.figures.time_series import time_series
    from ...report.figures.whiteness import whiteness

    for figure in (gap, time_series, whiteness):
        drawing = figure(comparison)
        if drawing is not None:
            drawing.save(folder)
