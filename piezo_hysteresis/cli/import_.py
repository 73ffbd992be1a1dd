"""Convert a recording of other software into an experiment, name its phases and check its data."""

from __future__ import annotations

import argparse

from .. import recording
from ..discrepancy.residual.noise_floor import noise_floors
from ..report.json_file import write_json
from ..report.tables.quality_table import notice_table, record_table
from . import reading
from .destination import require_new_experiment, require_new_file
from .terminal import console, show


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Declare the subcommand."""
    parser = subparsers.add_parser("import", description=__doc__)
    reading.add_arguments(parser)
    parser.add_argument(
        "-o", "--output", metavar="FOLDER", required=True, help="folder, or file ending .csv .mat .mcap"
    )
    parser.add_argument("--json", metavar="FILE", help="write phases and findings as JSON")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Read, write, and print what was found; returns 0.

    Raises
    ------
    PiezoError
        If the recording cannot be read or the experiment not be written.
    """
    require_new_experiment("-o", args.output)
    require_new_file("--json", args.json)
    experiment = reading.read(args)
    show(record_table(experiment, noise_floors(experiment.records)), notice_table(experiment))
    recording.write(experiment, args.output)
    console().print(f"wrote {len(experiment)} phases to {args.output}")
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
    return 0
