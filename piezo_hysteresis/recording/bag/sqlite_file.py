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
_MESSAGES = "SELECT topic_id, timestamp, data FROM messages ORDER BY id"


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
        with closing(self._connection()) as database:
            try:
                topics = {int(i): (str(name), str(kind)) for i, name, kind in database.execute(_TOPICS)}
                rows = database.execute(_MESSAGES)
            except (sqlite3.Error, TypeError, ValueError) as error:
                raise RecordingError(f"{self.path}: damaged or not a rosbag2 database ({error})") from None
            self._read_definitions(database)
            try:
                for topic, time_ns, data in rows:
                    if topic in topics and isinstance(data, bytes) and isinstance(time_ns, int):
                        yield *topics[topic], time_ns, data
            except (sqlite3.Error, MemoryError) as error:
                self.notices.append(Notice("cut", f"{self.path.name} is damaged ({error}): read up to there"))

    def _connection(self) -> sqlite3.Connection:
        place = f"file:{quote(str(self.path.absolute()))}?mode=ro"
        try:
            connection = sqlite3.connect(place, uri=True)
            connection.execute("SELECT 1 FROM sqlite_master").fetchone()
        except sqlite3.Error:
            # the write-ahead log of a killed recorder cannot be opened in a read-only folder
            connection = sqlite3.connect(place + "&immutable=1", uri=True)
        connection.text_factory = lambda raw: raw.decode("utf-8", "replace")
        return connection

    def _read_definitions(self, database: sqlite3.Connection) -> None:
        try:
            rows = database.execute("SELECT topic_type, encoding, encoded_message_definition FROM message_definitions")
            self.definitions.update({str(k): str(text) for k, encoding, text in rows if encoding == "ros2msg"})
        except sqlite3.Error:
            return  # bags of Humble carry no definitions
