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

"""`Bag`: the messages of a complete or truncated rosbag2 recording."""

from __future__ import annotations

import heapq
import re
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import NamedTuple, Protocol

from ...errors import RecordingError
from ...record import Notice
from ...yaml_file import read_regular_file
from .mcap_file import McapFile
from .sqlite_file import SqliteFile

REORDERING_HORIZON = 2_000_000_000
"""Largest deviation of the messages of a file from time order [ns]; recorders write them as they arrive."""

_LONGEST_METADATA = 1 << 22
"""Number of bytes of ``metadata.yaml`` in which the entry about compression is searched."""


class Message(NamedTuple):
    """One recorded message."""

    topic: str
    """Absolute topic name."""
    type: str
    """Message type, e.g. ``"std_msgs/msg/String"``."""
    time_ns: int
    """Time of reception [ns]."""
    raw: bytes
    """CDR with its encapsulation header."""


class BagFile(Protocol):
    """One storage file of a bag."""

    notices: list[Notice]
    """Findings about the file; complete after the last message."""
    definitions: dict[str, str]
    """Message type to its definition in the notation of .msg files, as far as the file carries it."""

    def messages(self) -> Iterator[tuple[str, str, int, bytes]]:
        """Topic, type, time [ns] and bytes of every message that can be read."""


STORAGES: dict[str, type[McapFile] | type[SqliteFile]] = {".mcap": McapFile, ".db3": SqliteFile}
"""Ending of a storage file to its reader."""


class Bag:
    """A rosbag2 directory, or one of its .mcap or .db3 files.

    Neither ``metadata.yaml`` nor an index is needed, so that the bag of a killed recorder can be read.

    Parameters
    ----------
    path : Path
        Folder or file.

    Attributes
    ----------
    notices : list of Notice
        Damage that was found; complete after the last message.

    Raises
    ------
    RecordingError
        If there is no storage file, or they are compressed as a whole.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        files = [path] if path.is_file() else sorted((f for f in path.iterdir() if f.is_file()), key=_order)
        self._files: list[BagFile] = [STORAGES[f.suffix](f) for f in files if f.suffix in STORAGES]
        packed = [f.name for f in files if f.suffix == ".zstd"]
        if packed:
            raise RecordingError(
                f"{path}: {packed[0]} is compressed as a whole, expected .mcap or .db3; run zstd -d on it"
            )
        if not self._files:
            raise RecordingError(f"{path}: got no .mcap or .db3 file, expected a rosbag2 bag")
        if _message_compression(path):
            raise RecordingError(f"{path}: messages are compressed one by one; convert the bag with `ros2 bag convert`")

    @property
    def notices(self) -> list[Notice]:
        return [notice for file in self._files for notice in file.notices]

    @property
    def definitions(self) -> dict[str, str]:
        """Message type to its definition, of the messages read so far."""
        return {name: text for file in self._files for name, text in file.definitions.items()}

    def messages(self, topics: Collection[str] | None = None) -> Iterator[Message]:
        """Messages in the order of the file.

        Parameters
        ----------
        topics : collection of str, optional
            Topics to read; default all.
        """
        for file in self._files:
            for message in file.messages():
                if topics is None or message[0] in topics:
                    yield Message(*message)

    def in_time_order(self, topics: Collection[str] | None = None) -> Iterator[Message]:
        """Messages sorted by time of reception, as a player sends them; memory is bounded by the reordering horizon."""
        waiting: list[tuple[int, int, Message]] = []
        for arrival, message in enumerate(self.messages(topics)):
            heapq.heappush(waiting, (message.time_ns, arrival, message))
            while message.time_ns - waiting[0][0] > REORDERING_HORIZON:
                yield heapq.heappop(waiting)[2]
        while waiting:
            yield heapq.heappop(waiting)[2]


def _order(file: Path) -> tuple[int, str]:
    number = re.search(r"_(\d{1,9})\.\w+$", file.name)
    return (int(number[1]) if number else 0, file.name)


def _message_compression(path: Path) -> bool:
    try:
        metadata = read_regular_file(path / "metadata.yaml", _LONGEST_METADATA)
    except (OSError, RecordingError):
        return False  # metadata are not needed to read a bag
    return re.search(rb"""(?im)^\s*compression_mode:\s*["']?message["']?\s*$""", metadata) is not None
