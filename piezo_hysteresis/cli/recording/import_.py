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

"""Convert a recording of other software into an experiment, name its phases and check its data."""

from __future__ import annotations

import argparse
from pathlib import Path

from ... import recording
from ...errors import RecordingError, counted
from ...home_path import in_home
from ...identification.records.noise_floor import noise_floors
from ...record import Experiment
from ...report.json_file import write_json
from ...report.tables.quality_table import notice_table, record_table, understood_table
from ..options import reading_options
from ..options.destination import require_new_experiment, require_new_file
from ..terminal import console, severe_status, show


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Declare the subcommand."""
    parser = subparsers.add_parser("import", description=__doc__)
    reading_options.add_arguments(parser)
    parser.add_argument(
        "-o", "--output", metavar="FOLDER", help="new folder, or file ending .csv .mat .mcap; needed without --preview"
    )
    parser.add_argument(
        "--preview", metavar="PICTURE", help="show what was understood: a table, and a new file ending .png .svg .pdf"
    )
    parser.add_argument("--json", metavar="FILE", help="write phases and findings as JSON")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Read, write, and print what was found; returns 0, or 1 with severe findings.

    Raises
    ------
    PiezoError
        If the recording cannot be read or the experiment not be written.
    """
    if args.output is None and args.preview is None:
        raise RecordingError("-o: got no output, expected one; give -o FOLDER, or --preview PICTURE to look only")
    if args.output is not None:
        require_new_experiment("-o", args.output)
    require_new_file("--preview", args.preview)
    require_new_file("--json", args.json)
    experiment = reading_options.read(args, rows_before=0)
    show(record_table(experiment, noise_floors(experiment.records)), notice_table(experiment))
    if args.preview is not None:
        _show_preview(experiment, in_home(args.preview))
    if args.output is not None:
        recording.write(experiment, args.output)
        console().print(f"wrote {counted(len(experiment), 'phase')} to {args.output}")
    if args.json is not None:
        write_json(
            args.json,
            {
                "schema": 1,
                "experiment": args.output,
                "phases": [
                    {
                        "phase": r.phase,
                        "samples": r.size,
                        "sample_period_s": r.sample_period,
                        "start_time_s": r.start_time,
                        "continues": r.continues,
                        "truncated": r.truncated,
                    }
                    for r in experiment
                ],
                "data_quality": [
                    {"kind": n.kind, "phase": n.phase, "message": n.message, "severe": n.severe}
                    for n in experiment.notices
                ],
            },
        )
    return severe_status(experiment.notices)


def _show_preview(experiment: Experiment, picture: Path) -> None:
    from ...report.figures.preview import preview  # matplotlib is slow to import

    show(understood_table(experiment))
    preview(experiment).save_picture(picture)
    console().print(f"wrote the picture {picture}")
