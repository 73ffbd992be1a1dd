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

"""Show an experiment in the browser: loops, displacement, residual and spectrum, with zoom into every sample.

With --rerun the same is written as a file for the Rerun viewer, with its views arranged.
"""

from __future__ import annotations

import argparse
import webbrowser
from contextlib import suppress
from pathlib import Path

from ...identification.records.one_axis import one_axis
from ...model import model_file
from ...report.figures.comparison import ModelComparison, compare
from ..options import destination, reading_options
from ..terminal import console, show_notices


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Declare the subcommand."""
    parser = subparsers.add_parser("view", description=__doc__)
    reading_options.add_arguments(parser)
    parser.add_argument("--model", metavar="FILE", help="model file whose prediction is drawn")
    parser.add_argument("--port", type=int, default=0, help="port on 127.0.0.1 (default: a free one)")
    parser.add_argument("--no-browser", action="store_true", help="only print the address")
    parser.add_argument("--rerun", metavar="FILE.rrd", help="write a file for the Rerun viewer instead (extra: rerun)")
    destination.add_force(parser)
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Serve the page until Ctrl-C, or write the file; returns 0.

    Raises
    ------
    PiezoError
        On files that cannot be read, or a port that is taken.
    """
    destination.require_new_file("--rerun", args.rerun, args.force)
    models = {} if args.model is None else {Path(args.model).stem: model_file.load(args.model)}
    experiment = reading_options.read(args, rows_before=0)
    if models:
        experiment = experiment.noting(*one_axis(experiment))
    comparison = compare(experiment, models)
    title = f"Recording {', '.join(Path(path).name for path in args.experiment)}"
    if args.rerun is not None:
        from ...report.rerun_file import write_rerun

        write_rerun(comparison, args.rerun, title)
        show_notices(experiment.notices)
        console().print(f"wrote {args.rerun}; to open it: rerun --bind 127.0.0.1 {args.rerun}")
        return 0
    return _serve(args, comparison, title)


def _serve(args: argparse.Namespace, comparison: ModelComparison, title: str) -> int:
    from ...report.live.recording_page import RecordingPage
    from ...report.live.server import PageServer

    server = PageServer(lambda document: RecordingPage(document, comparison, title), port=args.port)
    show_notices(comparison.experiment.notices)
    console().print(f"open {server.url} in a browser; Ctrl-C ends the server")
    if not args.no_browser:
        webbrowser.open(server.url)
    with suppress(KeyboardInterrupt):
        server.wait()
    server.close()
    return 0
