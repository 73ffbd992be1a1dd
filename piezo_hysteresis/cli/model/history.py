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

"""Show the recalibrations of a stage by the model node: every parameter over time, with its interval."""

from __future__ import annotations

import argparse
from pathlib import Path

from rich.table import Table

from ...changes.recalibration_history import FILE, read_numbers
from ...errors import RecordingError
from ...home_path import in_home
from ...yaml_file import read_regular_file
from ..options.destination import add_force, require_new_results
from ..terminal import console


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Declare the subcommand."""
    parser = subparsers.add_parser("history", description=__doc__)
    parser.add_argument("file", type=Path, metavar="FILE", help=f"{FILE}, or the folder of it")
    parser.add_argument("-o", "--output", metavar="PICTURE", help="figure to write: .png, .svg or .pdf")
    add_force(parser)
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Print the table and draw the figure; returns 0.

    Raises
    ------
    RecordingError
        If there is no history, or the figure cannot be written.
    """
    require_new_results(args)
    path = in_home(args.file)
    path = path / FILE if path.is_dir() else path
    try:
        numbers = read_numbers(read_regular_file(path).decode(), str(path))
    except RecordingError:
        raise
    except (OSError, UnicodeDecodeError) as error:
        raise RecordingError(
            f"{path}: cannot be read ({getattr(error, 'strerror', None) or error}), expected {FILE} of a model node"
        ) from None
    table = Table("time", "group", "parameter", "old", "new", "95 % interval", "unit", "residual, nm")
    for n in numbers:
        table.add_row(
            n.time,
            n.group,
            n.parameter,
            f"{n.old:.6g}",
            f"{n.new:.6g}",
            f"{n.low:.6g} to {n.high:.6g}",
            n.unit,
            f"{1e9 * n.residual_before:.3g} → {1e9 * n.residual_after:.3g}",
        )
    out = console()
    out.print(table)
    if args.output is not None:
        from ...report.recalibrations import recalibrations

        picture = in_home(args.output)
        recalibrations(numbers).save_picture(picture)
        out.print(f"wrote {picture}")
    return 0
