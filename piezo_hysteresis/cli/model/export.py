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

"""Write a model as a program that runs without Python.

The C files are a header, a source, and a self-test that compares the source with the model. They need only a C99
compiler. They contain the prediction and, if the model has one, the inverse with the limits of the drive. Every effect
of the catalogue can be written. The program is valid only at the sample period of the model.

Co-simulation units (FMI 3.0) contain the same code for Simulink, Dymola, OpenModelica and others, with a library for
this computer if it has a C compiler.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Mapping
from pathlib import Path

from ...compensation import Band, Inverse, Limits
from ...errors import ModelError, counted
from ...export import c_program, fmus
from ...export.fmu import compiler
from ...export.inversion import inversion
from ...home_path import in_home
from ...model import model_file
from ...model.model import Model
from ..options.destination import add_force, require_new_folder
from ..terminal import console


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Declare the subcommand."""
    parser = subparsers.add_parser("export", description=__doc__)
    parser.add_argument("model", metavar="MODEL", help="model file")
    parser.add_argument("--to", choices=("c", "fmu"), default="c", help="what to write (default: c)")
    parser.add_argument("-o", "--output", metavar="FOLDER", required=True, help="folder of the files")
    parser.add_argument(
        "--name",
        metavar="NAME",
        default="piezo",
        help="beginning of the names of files, functions and types; lets one program contain several models "
        "(default: piezo)",
    )
    parser.add_argument("--no-inverse", action="store_true", help="write the prediction only")
    parser.add_argument(
        "--voltage-min", metavar="V", type=float, default=0.0, help="lowest drive voltage of the inverse (default: 0)"
    )
    parser.add_argument(
        "--voltage-max",
        metavar="V",
        type=float,
        default=10.0,
        help="highest drive voltage of the inverse (default: 10)",
    )
    parser.add_argument(
        "--max-slew-rate",
        metavar="V/S",
        type=float,
        default=math.inf,
        help="steepest drive of the inverse (default: no limit)",
    )
    parser.add_argument(
        "--no-band",
        action="store_true",
        help="omit the low-pass of the wanted displacement: less preview is needed, but kinks of the path need very "
        "large voltages",
    )
    add_force(parser)
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Write the files; returns 0.

    Raises
    ------
    PiezoError
        On a model that cannot be read or exported, a name that is no identifier, or a folder that holds files.
    """
    require_new_folder("-o", args.output, args.force)
    model = model_file.load(args.model)
    inverse, why_not = _inverse(model, args)
    files = (c_program if args.to == "c" else fmus)(model, args.name, inverse)
    folder, out = in_home(args.output), console()
    _write(files, folder)
    old = folder / f"{args.name}_inverse.fmu"
    if args.to == "fmu" and inverse is None and old.is_file():  # of an earlier model
        old.unlink()
        out.print(f"removed {old.name}, which was there before: it is not the inverse of this model")
    out.print(f"wrote {', '.join(files)} to {args.output}")
    out.print(f"sample period: {model.sample_period:g} s; the model takes one sample in every such period")
    if inverse is not None:
        ahead = f"{counted(inverse.preview, 'sample')} ({inverse.preview_time:g} s)"
        out.print(f"inverse: the wanted displacement must be known {ahead} ahead")
    elif why_not:
        out.print(f"no inverse was written: {why_not}")
    if args.to == "c":
        out.print(f"check: cc -std=c99 {args.name}_test.c {args.name}.c -lm -o {args.name}_test && ./{args.name}_test")
    elif compiler() is None:
        out.print("no C compiler was found: the units hold sources only; install one, or name it in CC")
    return 0


def _inverse(model: Model, args: argparse.Namespace) -> tuple[Inverse | None, str]:
    """The inverse, or the reason why the model has none."""
    if args.no_inverse:
        return None, ""
    limits = Limits(args.voltage_min, args.voltage_max, args.max_slew_rate).resolved
    band = None if args.no_band else Band.of(model.sample_period)
    try:
        inverse = Inverse(model, limits, band=band)
        inversion(inverse)
    except ModelError as error:
        return None, str(error).partition(";")[0]
    return inverse, ""


def _write(files: Mapping[str, str] | Mapping[str, bytes], folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for name, content in files.items():
            draft = folder / f"{name}.tmp"
            draft.write_bytes(content.encode() if isinstance(content, str) else content)
            draft.replace(folder / name)
    except OSError as error:
        raise ModelError(f"{folder}: cannot be written ({error.strerror or error})") from None
