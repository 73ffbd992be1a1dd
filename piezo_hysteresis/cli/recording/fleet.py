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

"""Identify, validate or diagnose many recordings: one row of a Parquet table for each, and a page about them all.

If the command is repeated, only recordings with changed data, options or code are processed.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from ...errors import ParameterError, counted
from ...fleet.attempt import RowStatus
from ...fleet.cluster import cluster
from ...fleet.finding import find_recordings
from ...fleet.fleet import open_orders, run_fleet
from ...fleet.source import NamePattern
from ...fleet.storage import Storage
from ...fleet.table.results import Results
from ...fleet.work import TASKS, work_for
from ...home_path import in_home
from ...model import model_file
from ..options import reading_options
from ..options.destination import add_force, require_new_file
from ..options.operator_option import add_operator
from ..terminal import console, progress

TIME_LIMIT = 600.0
"""Time limit per recording if none is given [s]."""


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Declare the subcommand."""
    parser = subparsers.add_parser("fleet", description=__doc__)
    parser.add_argument(
        "urls",
        metavar="URL",
        nargs="*",
        help="recordings: files, folders (searched at any depth), patterns with * and **; local, s3:// or http://; "
        "without a URL only the page is written",
    )
    parser.add_argument(
        "-o", "--output", metavar="FOLDER", required=True, help="folder of the results, new or existing"
    )
    parser.add_argument(
        "--task", choices=TASKS, default=TASKS[0], help=f"what to do with every recording (default: {TASKS[0]})"
    )
    parser.add_argument("--model", metavar="FILE", help="model file to validate, or to start a diagnosis from")
    add_operator(parser)
    parser.add_argument(
        "--time-limit",
        metavar="S",
        type=float,
        default=TIME_LIMIT,
        help="time limit per recording [s] (default: %(default)g)",
    )
    parser.add_argument("--retry", action="store_true", help="try recordings again that failed, timed out or crashed")
    parser.add_argument(
        "--name",
        metavar="REGEX",
        default="",
        help="pattern for stage and date in a URL, with groups (?P<stage>…) and (?P<date>…); default: the folder "
        "of the recording, and the first date",
    )
    parser.add_argument(
        "--workers", metavar="N", type=int, help="processes on this machine (default: one per processor)"
    )
    parser.add_argument("--scheduler", metavar="tcp://…", help="Dask scheduler whose workers are used instead")
    parser.add_argument("--endpoint", metavar="URL", help="S3 server (default: AWS_ENDPOINT_URL, or Amazon's)")
    parser.add_argument("--anonymous", action="store_true", help="read S3 without keys")
    parser.add_argument("--report", metavar="FILE", help="write the HTML page about all rows of the task")
    add_force(parser)
    reading_options.add_reading_group(parser)
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Find the recordings, process them, and write the results; returns 1 where a recording has no result, otherwise 0.

    Raises
    ------
    PiezoError
        If options are invalid, or places cannot be reached.
    """
    if not args.time_limit > 0.0:
        raise ParameterError(f"--time-limit: got {args.time_limit:g} s, expected more than 0 s")
    if args.workers is not None and args.workers < 1:
        raise ParameterError(f"--workers: got {args.workers}, expected 1 or more")
    require_new_file("--report", args.report, args.force)
    if not args.urls and args.report is None:
        raise ParameterError("fleet: got no URL and no --report, expected recordings or the page to write")
    folder = in_home(args.output)
    missing = _worked(args, folder) if args.urls else ""
    if args.report is not None:
        from ...fleet.table.results_history import results_history
        from ...report.fleet.fleet_page import fleet_page

        fleet_page(results_history(folder, args.task)).save(in_home(args.report))
        console().print(f"wrote {args.report}")
    if missing:
        console().print(missing)
        return 1
    return 0


def _worked(args: argparse.Namespace, folder: Path) -> str:
    """Process the recordings; returns how many have no result, or nothing."""
    model = "" if args.model is None else model_file.dumps(model_file.load(args.model))
    work = work_for(args.task, model, args.hysteresis)
    reading = reading_options.keywords(args)
    places = {} if args.endpoint is None else {"endpoint": args.endpoint}
    sources = find_recordings(args.urls, Storage(**places, anonymous=args.anonymous), NamePattern(args.name))
    out = console()
    with Results(folder) as results:
        orders = open_orders(sources, work, results, reading=reading, limit=args.time_limit, retry=args.retry)
        out.print(f"recordings: {len(sources)}; with an up-to-date row: {len(sources) - len(orders)}")
        if orders:
            with (
                cluster(args.scheduler, args.workers) as client,
                progress(args.task, _workers(client)) as report_progress,
            ):
                out.print(run_fleet(orders, results, client, report_progress).sentence())
        without = sum(results.known[work.name, source.url].status != RowStatus.DONE for source in sources)
    out.print(f"wrote {folder}")
    missing = f"without a result: {without} of {len(sources)}; the column `error` of the table gives the reason"
    return missing if without else ""


def _workers(client: Any) -> str:
    threads = client.nthreads()
    several = sum(count > 1 for count in threads.values())
    said = f"{counted(len(threads), 'worker')}, dashboard at {client.dashboard_link}"
    return said + (f"; {several} of them with several threads: start workers with --nthreads 1" if several else "")
