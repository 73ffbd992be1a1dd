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

"""`StageLock`: allows one driver per stage on a computer; it ends with its process and the keeper of this. No ROS."""

from __future__ import annotations

import fcntl
import hashlib
import os
import stat
import time
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from typing import TextIO

from ..errors import StageError

FOLDERS = (Path("/run/lock"), Path("/tmp"))
"""Possible folders for locks; the first one in which every user may write is used."""


_OWN = set[Path]()
"""Files of the locks that this process holds."""
KEEPER_TIME = 10.0
"""Longest wait for the keeper of a driver that has ended [s]."""


class StageLock:
    """Locks on the devices and names that only one driver may use.

    Parameters
    ----------
    holds : iterable of str
        Descriptions of what is locked, for example ``"device E-727 0123"`` or ``"/stage_x/samples of domain 0"``.

    Raises
    ------
    StageError
        If another process holds one of the locks. All of them are then released.
    """

    def __init__(self, holds: Iterable[str]) -> None:
        self._files: dict[Path, TextIO] = {}
        for what in holds:
            try:
                self.add(what)
            except StageError:
                self.release()
                raise

    def add(self, what: str) -> None:
        """Add a lock; raises StageError if another process holds it."""
        path = _folder() / f"piezo_hysteresis_{hashlib.sha256(what.encode()).hexdigest()[:16]}.lock"
        self._files[path] = _lock(what, path)
        _OWN.add(path)

    @property
    def descriptors(self) -> list[int]:
        """File descriptors of all locks; a process that inherits them holds the locks, too."""
        return [file.fileno() for file in self._files.values()]

    def release(self) -> None:
        """Release all locks; may be repeated. A keeper that moves the stage still holds its own."""
        for path, file in self._files.items():
            file.close()
            _OWN.discard(path)
        self._files.clear()


def _folder() -> Path:
    """Folder of the locks; it is the same for every user, so that two drivers of one device find the same lock."""
    for folder in FOLDERS:
        if folder.is_dir() and folder.stat().st_mode & stat.S_IWOTH:
            return folder
    return FOLDERS[-1]


def _opened(path: Path) -> int:
    """Descriptor of a file that every user may open; it is created if it does not exist.

    The file is first opened without O_CREAT, because with it Linux refuses the file of another user in such folders.
    """
    flags = os.O_RDWR | os.O_CLOEXEC | os.O_NOFOLLOW
    with suppress(FileNotFoundError):
        return os.open(path, flags)
    try:
        descriptor = os.open(path, flags | os.O_CREAT | os.O_EXCL, 0o666)
    except FileExistsError:  # another driver created it at the same time
        return os.open(path, flags)
    os.fchmod(descriptor, 0o666)  # independent of the umask
    return descriptor


def _taken(file: TextIO) -> bool:
    """Take the lock on a file; False if another process holds it."""
    with suppress(OSError):
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        return True
    return False


def _is_left(process: str, path: Path) -> bool:
    """Whether the process with this number has ended, or is this one and has released the lock: its keeper holds it."""
    if not process.isdecimal():
        return False
    if int(process) == os.getpid():
        return path not in _OWN
    try:
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] in "ZX"
    except OSError:
        return True


def _lock(what: str, path: Path) -> TextIO:
    try:
        descriptor = _opened(path)
    except OSError as error:
        raise StageError(
            f"{what}: cannot make the lock {path} ({error.strerror}); expected a writable folder"
        ) from None
    file = os.fdopen(descriptor, "r+", encoding="utf-8", errors="replace")
    end = time.monotonic() + KEEPER_TIME
    while not _taken(file):
        file.seek(0)
        holder = file.read(20).strip() or "unknown"
        is_left = _is_left(holder, path)
        if is_left and time.monotonic() < end:
            time.sleep(0.05)
            continue
        file.close()
        raise StageError(
            f"{what}: the keeper of process {holder} still brings the stage to its safe voltage; try again"
            if is_left
            else f"{what} is held by process {holder} already; end that one or take another namespace"
        )
    file.seek(0)
    file.truncate(0)
    file.write(f"{os.getpid()}\n")
    file.flush()
    return file
