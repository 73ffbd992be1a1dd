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

"""Copies the files of a recording to this machine, and computes their hash."""

from __future__ import annotations

import hashlib
import shutil
import stat
from contextlib import ExitStack
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from ..errors import RecordingError
from .source import Source

BLOCK = 1 << 20
"""Number of bytes that are read at once."""


def fetch(source: Source, stack: ExitStack) -> Path:
    """Make a recording readable on this machine.

    Parameters
    ----------
    source : Source
    stack : ExitStack
        Its end removes a copy.

    Returns
    -------
    Path
        The recording itself if it is on a disk, otherwise a copy.

    Raises
    ------
    Exception
        Any exception of the storage, if it cannot be reached.
    """
    if "://" not in source.url:
        path = Path(source.folder or source.files[0])
        for file in source.files:
            if not stat.S_ISREG(Path(file).stat().st_mode):
                raise RecordingError(f"{file} is no regular file, expected one")
        return path
    fs, _ = source.storage.open(source.url)
    copy = Path(stack.enter_context(TemporaryDirectory(prefix="piezo_fleet_")))
    name = (source.folder or source.files[0]).rstrip("/").rpartition("/")[2]
    target = copy / (name.partition("?")[0] or "recording")
    if not source.folder:
        _copy(fs, source.files[0], target)
        return target
    target.mkdir()
    for file in source.files:
        _copy(fs, file, target / file.rpartition("/")[2])
    return target


def _copy(fs: Any, file: str, target: Path) -> None:
    """Copy a file. For S3, `get_file` is not used: it first asks whether the file is a folder, a third of the time."""
    if fs.protocol != "s3":
        fs.get_file(file, str(target))
        return
    with fs.open(file, "rb") as content, target.open("wb") as copy:
        shutil.copyfileobj(content, copy, BLOCK)


def content_hash(source: Source, path: Path) -> str:
    """``sha256:`` and 16 digits of the bytes of a recording, and of the names of its files if it is a folder.

    Parameters
    ----------
    source : Source
    path : Path
        Result of `fetch`.
    """
    digest = hashlib.sha256()
    files = [path / file.rpartition("/")[2] for file in source.files] if source.folder else [path]
    for file in sorted(files):
        if source.folder:
            digest.update(f"{file.name} {file.stat().st_size}\n".encode())
        with file.open("rb") as content:
            while block := content.read(BLOCK):
                digest.update(block)
    return "sha256:" + digest.hexdigest()[:16]
