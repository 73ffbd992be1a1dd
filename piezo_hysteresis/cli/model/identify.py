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

"""Identify delay, dynamics and hysteresis of a stage from a recording, with uncertainties."""

from __future__ import annotations

import argparse
from dataclasses import replace
from typing import Any

from ...effects import HYSTERESIS, OPERATORS, PublishedBoucWen
from ...errors import ParameterError, counted
from ...identification.identification import Identification, undetermined
from ...identification.identify import identify
from ...identification.records.roles import HELD_OUT
from ...identification.structure.mode import assumed_numbers
from ...model import model_file
from ...model.axes_samples import has_several_axes
from ...notice import Notice
from ...report.json_file import write_json
from ...report.tables.parameter_table import correlation_table, parameter_table
from ...report.tables.table import Table
from ...report.words import describes, error_sentence
from ..options import reading_options
from ..options.destination import add_results, require_new_results
from ..options.operator_option import add_operator
from ..terminal import console, progress, show, show_notices, usual_time
from . import several_axes

DEFAULT = "model.yaml"
"""Name of the model file, unless another is given."""


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Declare the subcommand."""
    parser = subparsers.add_parser("identify", description=__doc__)
    reading_options.add_arguments(parser)
    parser.add_argument(
        "-o", "--output", metavar="FILE", help="model file (default: model.yaml; several axes: model.npz)"
    )
    orders = parser.add_mutually_exclusive_group()
    orders.add_argument(
        "--orders", metavar=("NA", "NB"), nargs=2, type=int, help="orders of the ARX model (default: 8 8, as published)"
    )
    orders.add_argument("--choose-orders", action="store_true", help="choose the lowest orders with a good prediction")
    parser.add_argument(
        "--taps", metavar="N", type=int, help="several axes: length of every impulse response [samples] (default: 250)"
    )
    operator = parser.add_mutually_exclusive_group()
    add_operator(operator)
    operator.add_argument(
        "--published",
        dest="hysteresis",
        action="store_const",
        const=PublishedBoucWen.name,
        help="Bouc-Wen in the discrete form of the paper, Eq. (7)",
    )
    parser.set_defaults(hysteresis=None)
    parser.add_argument(
        "--no-memory",
        action="store_true",
        help="keep hysteresis and dynamics alone even if another structure predicts better",
    )
    parser.add_argument(
        "--held-out",
        metavar="PHASE",
        action="append",
        help=f"phase that is not fitted; the model is tested on it (default: {', '.join(HELD_OUT)})",
    )
    add_results(parser, json="write the result as JSON")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Identify, print and save; returns 0, or 1 where the verdict is that the model cannot be trusted.

    Raises
    ------
    PiezoError
        If the input is invalid, or the data do not determine the model.
    """
    require_new_results(args)
    experiment = reading_options.read(args)
    if has_several_axes(experiment):
        return several_axes.identify(experiment, args)
    if args.output is None:
        args.output = DEFAULT
        require_new_results(args)
    if args.taps is not None:
        raise ParameterError(f"--taps: got {args.taps} for a stage of one axis, expected several axes or no --taps")
    model_file.require_name(args.output)
    if args.orders is not None and not (args.orders[0] >= 0 and args.orders[1] >= 1):
        got = " ".join(map(str, args.orders))
        raise ParameterError(f"--orders: got {got}, expected NA of at least 0 and NB of at least 1")
    orders = None if args.choose_orders else tuple(args.orders or (8, 8))
    with progress("identify", usual_time(experiment.size, "2 s", 1)) as report_progress:
        found = identify(
            experiment,
            orders=orders,
            hysteresis=OPERATORS[args.hysteresis or HYSTERESIS.name],
            memory=not args.no_memory,
            held_out=HELD_OUT if args.held_out is None else tuple(args.held_out),
            progress=report_progress,
        )
    if found.dynamics is None and (args.choose_orders or args.orders is not None):
        found = replace(found, notices=(*found.notices, _without_orders(args)))
    path = model_file.save(found.model, args.output)
    verdict, severe = verdict_line(found), any(notice.severe for notice in found.notices)
    trusted = found.fit.converged and describes(found.free_run_percent) and not severe
    if args.json is not None:
        said = {"verdict_text": verdict.removeprefix("Verdict: "), "trusted": trusted}
        write_json(args.json, {**answer(found, str(path)), **said})
    show(parameter_table(found.model, found.fit), correlation_table(found.fit), _phases(found))
    out = console()
    if found.delay is not None:
        out.print(str(found.delay))
    for comparison in found.comparisons:
        out.print(str(comparison))
    show_notices(found.notices)
    out.print(f"wrote {path}")
    out.print(verdict, style="bold")
    return 0 if trusted else 1


def _without_orders(args: argparse.Namespace) -> Notice:
    option = "--choose-orders" if args.choose_orders else "--orders"
    message = "no fitted record is broadband, so the orders of the dynamics follow from the structure that was chosen"
    return Notice("orders", f"{option} has no effect: {message}; record noise or a multisine")


def verdict_line(found: Identification) -> str:
    """The result in a few sentences. The mean error over the phases can hide one that is described badly."""
    fit, percent = found.fit, found.free_run_percent
    if not fit.converged:
        return (
            f"Verdict: not determined. The fit stopped after {counted(fit.iterations, 'linearisation')}, before it had "
            "converged, so the values above are not estimates; give phases that move the stage over its range at "
            "several rates."
        )
    severe = sum(n.severe for n in found.notices)
    caveat = (
        f" {severe} severe finding{'s' * (severe > 1)} above make{'s' * (severe == 1)} it doubtful." if severe else ""
    )
    names = ", ".join(undetermined(fit))
    at_bounds = f" At a bound of the range, and therefore without an interval: {names}." if names else ""
    over = "" if all(p.is_fitted for p in found.phases) else " This is the error over the phases that were not fitted."
    largest = ""
    if len(found.phases) > 1:
        worst = max(found.phases, key=lambda p: p.percent)
        largest = f" The error is largest in {worst.phase}: {worst.percent:.3g} % of range."
    return f"Verdict: {error_sentence(percent)}{over}{largest}{caveat}{at_bounds}"


def answer(found: Identification, path: str) -> dict[str, Any]:
    """The result for machines."""
    fit, assumed = found.fit, assumed_numbers(found.model)
    unsure = {*fit.at_bounds, *assumed}
    values = found.model.values()
    return {
        "schema": 1,
        "model": path,
        "converged": fit.converged,
        "effects": [e.name for e in found.model.effects],
        "parameters": {
            name: {
                "value": values[name],
                "interval_95": None if name in unsure else fit.interval(name),
                "at_bound": name in fit.at_bounds,
            }
            for name in dict.fromkeys((*fit.names, *assumed))
        },
        "delay_s": None if found.delay is None else found.delay.time,
        "correlated": [list(pair) for pair in found.correlated],
        "free_run_error_m": found.free_run_error,
        "free_run_error_percent_of_range": found.free_run_percent,
        "phases": [
            {"phase": p.phase, "rms_m": p.rms, "percent_of_range": p.percent, "fitted": p.is_fitted}
            for p in found.phases
        ],
        "notices": [
            {"kind": n.kind, "phase": n.phase, "message": n.message, "severe": n.severe} for n in found.notices
        ],
    }


def _phases(found: Identification) -> Table:
    rows = tuple(
        (p.phase, f"{p.percent:.3f}", f"{1e9 * p.rms:.1f}", "fitted" if p.is_fitted else "not fitted")
        for p in found.phases
    )
    unseen = any(not p.is_fitted for p in found.phases)
    judged = f"{'the phases that were not fitted' if unseen else 'all (fitted) phases'} in which the drive moves"
    span = 100.0 * found.free_run_error / found.free_run_percent if found.free_run_percent else 0.0
    note = (
        f"The sensor zero is fitted for every phase. The range is {1e6 * span:.4g} µm, peak to peak over the "
        f"experiment. Error over {judged}, with equal weights: {found.free_run_percent:.3g} %."
    )
    return Table("Free-run error", ("phase", "% of range", "nm", "data"), rows, note, frozenset({1, 2}))
