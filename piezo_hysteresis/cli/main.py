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

"""`piezo`: one command for everything that needs no ROS.

Exit status: 0 done, also for every verdict of ``piezo diagnose``; 1 if the result cannot be trusted, is incomplete or
missing; 2 for bad input, which cannot be read or used.
"""

from __future__ import annotations

import io
import os
import sys
from contextlib import redirect_stdout
from importlib import import_module
from typing import TYPE_CHECKING

from .. import __version__
from ..errors import IdentificationError, PiezoError, printable

if TYPE_CHECKING:
    import argparse
    from collections.abc import Sequence

COMMANDS = {
    "stage": {
        "simulate": "play a protocol to a simulated stage and record it",
        "record": "play a protocol to a stage and record it, without ROS",
        "emulate": "emulate a controller behind a TCP port",
        "calibrate": "measure the delay of a card without a stage",
        "follow": "show the progress of the identification node in one line; needs ROS 2",
    },
    "model": {
        "identify": "identify a model from an experiment",
        "recalibrate": "fit gain, offset, loop height and lag of an existing model to new records",
        "history": "show the recalibrations of a stage over time",
        "validate": "compare a model with an experiment in free-run simulation",
        "diagnose": "find where a model is wrong and which effect is missing",
        "compensate": "compute the drive voltage for a wanted displacement",
        "export": "write a model as C code or co-simulation unit (FMU)",
        "effects": "list the catalogue of physical effects",
    },
    "recording": {
        "import": "convert a recording of other software into an experiment",
        "view": "show an experiment in the browser, with zoom",
        "report": "write one page about an experiment and its models",
        "fleet": "identify, validate or diagnose many recordings, one row of a table for each",
    },
}
"""Subcommands with a short description, by folder; the file of a subcommand is loaded only when it is called."""

DONE, NOT_IDENTIFIABLE, BAD_INPUT, INTERRUPTED, BROKEN_PIPE = 0, 1, 2, 130, 141
"""Exit codes of `piezo`."""


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line; returns the exit status.

    Parameters
    ----------
    argv : sequence of str, optional
        Arguments without the program name; default those of the process.
    """
    arguments = list(sys.argv[1:] if argv is None else argv)
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")  # units and symbols must not end a command on another encoding
    chosen = next((a for a in arguments if not a.startswith("-")), None)
    try:
        args = _arguments(chosen, arguments)
        status = int(args.run(args))
        sys.stdout.flush()
        return status
    except IdentificationError as error:
        return _print_error(_by_option(str(error), arguments), NOT_IDENTIFIABLE)
    except (PiezoError, OSError) as error:
        _drop_unwritable()
        if isinstance(error, BrokenPipeError):
            return BROKEN_PIPE
        return _print_error(_by_option(str(error), arguments), BAD_INPUT)
    except MemoryError:
        return _print_error("the recording does not fit into memory; decimate it or give fewer rows", BAD_INPUT)
    except KeyboardInterrupt as interrupt:
        return _print_error(": ".join(["interrupted", *map(str, interrupt.args)]), INTERRUPTED)


def _arguments(chosen: str | None, arguments: Sequence[str]) -> argparse.Namespace:
    """Parse; a help that cannot be written is an error, although argparse ignores it."""
    said = io.StringIO()
    try:
        with redirect_stdout(said):
            return _parser(chosen).parse_args(arguments)
    except SystemExit:
        sys.stdout.write(said.getvalue())
        sys.stdout.flush()
        raise


def _by_option(message: str, arguments: Sequence[str]) -> str:
    """A message that begins with the argument of a function, with the option that was given for it instead.

    >>> _by_option("way_back: got -1 s, expected zero or a finite time", ["compensate", "--way-back", "-1"])
    '--way-back: got -1 s, expected zero or a finite time'
    """
    name, colon, rest = message.partition(":")
    option = f"--{name.replace('_', '-')}"
    return f"{option}{colon}{rest}" if option in (a.partition("=")[0] for a in arguments) else message


def _drop_unwritable() -> None:
    """Leave nothing for the interpreter to flush if the output has ended or its disk is full."""
    try:
        sys.stdout.flush()
    except OSError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _parser(chosen: str | None) -> argparse.ArgumentParser:
    from .one_line_parser import OneLineParser  # nothing slow is imported before `main` can report an interrupt

    parser = OneLineParser(
        prog="piezo",
        description="Identify models of piezo stages, check them, and find missing physical effects.",
        epilog="exit status: 0 success, also for every verdict of `piezo diagnose`; 1 if the result cannot be trusted, "
        "is incomplete or missing (the last line says why); 2 for bad input",
    )
    parser.add_argument("--version", action="version", version=f"piezo_hysteresis {__version__}")
    subparsers = parser.add_subparsers(metavar="COMMAND", required=True)
    for folder, commands in COMMANDS.items():
        for name, summary in commands.items():
            if name == chosen:
                file = "import_" if name == "import" else name
                import_module(f".{folder}.{file}", __package__).add_parser(subparsers)
            else:
                subparsers.add_parser(name, help=summary)
    return parser


def _print_error(message: object, status: int) -> int:
    print(f"piezo: {printable(' '.join(str(message).split()))}", file=sys.stderr)
    return status


if __name__ == "__main__":
    sys.exit(main())
