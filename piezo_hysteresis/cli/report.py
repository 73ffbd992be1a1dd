"""``piezo report``: one self-contained page about an experiment and the models held against it."""

from __future__ import annotations

import argparse
from pathlib import Path

from ..identification.fit.normal_equations import Nuisance
from ..model import model_file
from ..report.figures.comparison import compare
from ..report.json_file import read_json
from ..report.page import page
from . import reading
from .terminal import console, progress


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Declare the subcommand."""
    parser = subparsers.add_parser("report", description=__doc__)
    reading.add_arguments(parser)
    parser.add_argument("-o", "--output", metavar="FILE", default="report.html", help="page (default: report.html)")
    parser.add_argument(
        "--model",
        metavar="[LABEL=]FILE",
        action="append",
        default=[],
        help="model file; the first is the one before, the last the one reported (repeatable)",
    )
    parser.add_argument("--answer", metavar="FILE", help="answer of piezo diagnose --json")
    parser.add_argument("--zero-per-phase", action="store_true", help="sensor zero free in every phase, not only once")
    parser.add_argument("--title", default="Piezo stage: model against measurement", help="heading of the page")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Draw and write the page; returns 0.

    Raises
    ------
    PiezoError
        On files that cannot be read or written.
    """
    models = {}
    for text in args.model:
        label, equals, path = text.rpartition("=")
        models[label if equals else Path(path).stem] = model_file.load(path)
    answer = None if args.answer is None else read_json(args.answer)
    experiment = reading.read(args)
    nuisances = dict.fromkeys(models, Nuisance(offset=True)) if args.zero_per_phase else None
    with progress("report") as report_progress:
        drawn = page(compare(experiment, models, nuisances), answer=answer, title=args.title, progress=report_progress)
    path = Path(args.output).expanduser()
    drawn.save(path)
    console().print(f"wrote {path} and {len(drawn.drawings)} figures beside it")
    return 0
