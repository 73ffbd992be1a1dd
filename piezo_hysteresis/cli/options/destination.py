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

"""Options for output files.

Existing files are refused before the work starts, unless the user allows to replace them.
"""

from __future__ import annotations

import argparse
import os
from pathlib import Path

from ...errors import RecordingError
from ...home_path import in_home


def add_results(parser: argparse.ArgumentParser, **contents: str) -> None:
    """Declare options for output files, and ``--force``.

    Parameters
    ----------
    parser : argparse.ArgumentParser
        Parser of the subcommand.
    **contents : str
        Help text for every option: ``figures``, ``report``, ``json``.
    """
    for name, content in contents.items():
        parser.add_argument(f"--{name}", metavar="FOLDER" if name == "figures" else "FILE", help=content)
    add_force(parser)


def add_force(parser: argparse.ArgumentParser) -> None:
    """Declare ``--force``."""
    parser.add_argument("--force", action="store_true", help="replace files that exist")


def require_new_results(args: argparse.Namespace) -> None:
    """Refuse existing output files and a folder for figures that is not empty, unless ``--force`` is given.

    Parameters
    ----------
    args : argparse.Namespace
        With ``output`` or any option that `add_results` has declared.

    Raises
    ------
    RecordingError
        As `require_new_file` and `require_new_folder`; and for one file given twice.
    """
    taken: dict[Path, str] = {}
    for option, name in (("-o", "output"), ("--report", "report"), ("--json", "json")):
        path = getattr(args, name, None)
        require_new_file(option, path, args.force)
        if path is not None and (other := taken.setdefault(in_home(path).absolute(), option)) != option:
            raise RecordingError(f"{option}: got {path} as for {other}, expected another file")
    require_new_folder("--figures", getattr(args, "figures", None), args.force)


def require_new_file(option: str, path: str | None, force: bool | None = None) -> None:
    """Refuse a file that exists.

    Parameters
    ----------
    option : str
        What the user typed before it, e.g. ``"--truth"``.
    path : str or None
        The file; None where the option was not given.
    force : bool, optional
        Whether ``--force`` was given; None where the command does not have it.

    Raises
    ------
    RecordingError
        If it exists, or its folder does not, or the folder cannot be written.
    """
    if path is None:
        return
    place = in_home(path)
    if place.exists() and not (force and place.is_file()):
        way_out = "remove it" if force is None or not place.is_file() else "give --force to replace it"
        raise RecordingError(f"{option}: {place} exists already, expected a new file; choose another name or {way_out}")
    if not place.absolute().parent.is_dir():
        raise RecordingError(f"{option}: {place.parent} is no folder, expected one that exists; create it")
    _require_writable(option, place.absolute().parent)


def require_new_experiment(option: str, path: str) -> None:
    """Refuse a place for an experiment that is not empty.

    Parameters
    ----------
    option : str
        What the user typed before it, e.g. ``"-o"``.
    path : str
        As for `recording.write`: a folder, or a file ending .csv, .mat or .mcap.

    Raises
    ------
    RecordingError
        If it exists and is not an empty folder, or cannot be made.
    """
    place = in_home(path)
    place = place.with_suffix("") if place.suffix == ".mcap" else place
    empty = place.is_dir() and place.suffix not in (".csv", ".mat") and not any(place.iterdir())
    if (place.exists() or place.is_symlink()) and not empty:
        raise RecordingError(f"{option}: {place} exists already, expected a new name; choose another one or remove it")
    _require_writable(option, place.absolute().parent)


def require_new_folder(option: str, path: str | None, force: bool) -> None:
    """Refuse a folder that is not empty.

    Parameters
    ----------
    option : str
        What the user typed before it, e.g. ``"--figures"``.
    path : str or None
        The folder; None where the option was not given.
    force : bool
        Whether files in it may be replaced.

    Raises
    ------
    RecordingError
        If it is a file or not empty, or cannot be made or written.
    """
    if path is None:
        return
    place = in_home(path)
    if place.exists() and not place.is_dir():
        raise RecordingError(f"{option}: {place} is a file, expected a folder; choose another name")
    if place.is_dir() and any(place.iterdir()) and not force:
        raise RecordingError(
            f"{option}: {place} holds files already, expected an empty or a new folder; choose another name or give "
            "--force to write into it"
        )
    _require_writable(option, place.absolute())


def _require_writable(option: str, folder: Path) -> None:
    """Refuse a folder if it cannot be written, or cannot be made where it is missing."""
    present = next(place for place in (folder, *folder.parents) if place.exists())
    if not (present.is_dir() and os.access(present, os.W_OK | os.X_OK)):
        raise RecordingError(f"{option}: got a place in {present}, expected a folder that can be written")
