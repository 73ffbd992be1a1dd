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

"""`SqliteFile`: messages of a rosbag2 .db3 file."""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from urllib.parse import quote

from ...errors import RecordingError
from ...record import Notice

_TOPICS = "SELECT id, name, type FROM topics WHERE serialization_format = 'cdr'"
"""Names and types of the topics."""

_MESSAGES = "SELECT topic_id, timestamp, data FROM messages ORDER BY id"
"""Messages in the order in which they were recorded."""

_DEFINITIONS = "SELECT topic_type, encoding, encoded_message_definition FROM message_definitions"
"""Definitions of the message types, in bags later than those of Humble."""

_SIDECARS = ("-wal", "-shm", "-journal")
"""Endings of the files that SQLite may keep beside a database."""

_STEPS_BETWEEN_CHECKS = 1000
"""Steps of the database engine between two checks of their number."""

_STEPS, _STEPS_PER_BYTE = 1_000_000, 20
"""Largest number of steps of the database engine, constant part and per byte; a row takes about twenty steps."""


class SqliteFile:
    """One .db3 file, opened for reading only."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.notices: list[Notice] = []
        self.definitions: dict[str, str] = {}

    def messages(self) -> Iterator[tuple[str, str, int, bytes]]:
        """Topic, type, time [ns] and bytes of every message up to where the database is damaged.

        Raises
        ------
        RecordingError
            If the file is no rosbag2 database.
        """
        self.notices.clear()
        size = self._size()
        with closing(self._connection(size)) as database:
            try:
                _require_tables(database)
                topics = {int(i): (str(name), str(kind)) for i, name, kind in database.execute(_TOPICS)}
                rows = database.execute(_MESSAGES)
                self._read_definitions(database)
            except (sqlite3.Error, TypeError, ValueError) as error:
                raise RecordingError(f"{self.path}: damaged or not a rosbag2 database ({error})") from None
            try:
                for topic, time_ns, data in rows:
                    if topic in topics and isinstance(data, bytes) and isinstance(time_ns, int):
                        size -= len(data)
                        if size < 0:  # pages or default values that are used repeatedly
                            raise sqlite3.DatabaseError("its messages are longer than the file")
                        yield *topics[topic], time_ns, data
            except (sqlite3.Error, MemoryError) as error:
                self.notices.append(Notice("cut", f"{self.path.name} is damaged ({error}); the part before was read"))

    def _size(self) -> int:
        """Bytes of the file and of its write-ahead log; RecordingError where one of them is a pipe or a device."""
        files = [self.path, *(self.path.with_name(self.path.name + end) for end in _SIDECARS)]
        strange = [file.name for file in files if file.exists() and not file.is_file()]
        if strange:
            raise RecordingError(f"{self.path}: {strange[0]} is no regular file, expected a rosbag2 database")
        return sum(file.stat().st_size for file in files if file.exists())

    def _connection(self, size: int) -> sqlite3.Connection:
        """Open the database with limits on memory and steps that suffice for a file of `size` bytes."""
        place = f"file:{quote(str(self.path.absolute()))}?mode=ro"
        try:
            connection = sqlite3.connect(place, uri=True)
            connection.execute("SELECT 1 FROM sqlite_master").fetchone()
        except sqlite3.Error:
            # the write-ahead log of a killed recorder cannot be opened in a read-only folder
            connection = sqlite3.connect(place + "&immutable=1", uri=True)
        connection.execute("PRAGMA trusted_schema = OFF")
        connection.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, max(size, 1 << 16))
        connection.setlimit(sqlite3.SQLITE_LIMIT_ATTACHED, 0)
        left = iter(range((_STEPS + _STEPS_PER_BYTE * size) // _STEPS_BETWEEN_CHECKS))
        connection.set_progress_handler(lambda: next(left, None) is None, _STEPS_BETWEEN_CHECKS)
        connection.text_factory = lambda raw: raw.decode("utf-8", "replace")
        return connection

    def _read_definitions(self, database: sqlite3.Connection) -> None:
        if "message_definitions" in _kinds(database):  # bags of Humble carry no definitions
            rows = database.execute(_DEFINITIONS)
            self.definitions.update({str(k): str(text) for k, encoding, text in rows if encoding == "ros2msg"})


def _kinds(database: sqlite3.Connection) -> dict[str, str]:
    """Name of everything in the database that can be read to its kind: table, view, virtual or shadow."""
    return {str(row[1]): str(row[2]) for row in database.execute("PRAGMA main.table_list")}


def _require_tables(database: sqlite3.Connection) -> None:
    """Raise RecordingError on views, virtual tables and computed columns, because they run code of their author."""
    kinds = _kinds(database)
    for name in ("topics", "messages", "message_definitions"):
        kind = kinds.get(name, "table")
        if kind != "table":
            raise RecordingError(f"'{name}' is a {kind}, expected a table as rosbag2 writes it")
        if any(row[6] for row in database.execute(f"PRAGMA main.table_xinfo({name})")):
            raise RecordingError(f"'{name}' has computed columns, expected a table as rosbag2 writes it")
