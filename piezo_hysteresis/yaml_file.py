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

"""Settings from YAML files. A wrong or hostile file is refused within bounded memory and time."""

from __future__ import annotations

import os
import stat
from pathlib import Path
from typing import Any

import yaml

from .errors import RecordingError

LONGEST = 1 << 16
"""Largest settings file that is read [bytes]."""


class _PlainLoader(yaml.SafeLoader):  # type: ignore[misc]  # yaml carries no types
    """Loader of plain values only, because with aliases a short file can fill the memory."""

    def compose_node(self, parent: yaml.Node | None, index: int) -> yaml.Node | None:
        if self.check_event(yaml.AliasEvent):
            raise yaml.YAMLError("aliases are not allowed, write the value")
        return super().compose_node(parent, index)


def read_regular_file(path: Path, longest: int = -1) -> bytes:
    """The bytes of a regular file, up to `longest`; never waits for a pipe or a device.

    Parameters
    ----------
    path : Path
        The file.
    longest : int
        Largest number of bytes to read; by default all.

    Raises
    ------
    OSError
        If it cannot be opened.
    RecordingError
        If it is a folder, a pipe or a device.
    """
    descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
    if not stat.S_ISREG(os.fstat(descriptor).st_mode):
        os.close(descriptor)
        raise RecordingError(f"{path}: got a folder, a pipe or a device, expected a regular file")
    with open(descriptor, "rb") as file:
        return file.read(longest)


def read_yaml(path: Path) -> Any:
    """The content of a settings file.

    Parameters
    ----------
    path : Path
        The file.

    Raises
    ------
    RecordingError
        If there is no such file, it cannot be read, is longer than `LONGEST`, or is not plain YAML.
    """
    try:
        raw = read_regular_file(path, LONGEST + 1)
    except RecordingError:
        raise
    except OSError as error:
        raise RecordingError(f"{path}: {error.strerror or error}, expected a YAML file") from None
    if len(raw) > LONGEST:
        raise RecordingError(f"{path}: got more than {LONGEST} bytes, expected a YAML file with settings")
    try:
        return yaml.load(raw.decode("utf-8"), _PlainLoader)
    except (yaml.YAMLError, ValueError, RecursionError) as error:  # ValueError: dates that do not exist
        reason = " ".join(str(error).split())[:120]
        raise RecordingError(f"{path}: broken YAML ({reason})") from None
