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

"""`BagWriter`: a rosbag2 directory that can be read even if the recorder is killed."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from types import TracebackType
from typing import Any

import yaml
from mcap.writer import CompressionType, Writer
from rosbags.typesys import Stores, get_typestore

from ...errors import RecordingError
from ...home_path import in_home
from ..checks.error_context import naming
from .written_file import check_in_place

CHUNK_BYTES = 1024 * 1024
"""Messages are indexed and written in chunks of this size; a cut file loses at most the last one. The index stays in
memory until the bag is closed, 0.6 kB for each chunk: smaller chunks would fill it in hours at high rates."""

FLUSH_INTERVAL = 0.5
"""Longest time for which a message stays in memory while others arrive [s]: no message older than a second is lost."""

_FOREVER = {"sec": 9223372036, "nsec": 854775807}
"""Longest duration of ROS."""
_EXPECTED = "a folder in which a bag can be written"
"""What is expected in place of a folder that cannot be written."""


class BagWriter:
    """Incremental recorder of serialised messages as rosbag2 directory, storage mcap, version 9.

    ``<bag>/<bag>_0.mcap`` grows in small chunks that reach the file twice a second; ``metadata.yaml`` is valid
    from the start and complete after `close`.

    Parameters
    ----------
    path : Path
        The bag's folder, which must not exist.

    Raises
    ------
    RecordingError
        If the folder exists or cannot be made, and from every method once the disk is full or gone, or file or folder
        were deleted, moved, or may not be written any more.

    Examples
    --------
    >>> with BagWriter("run_1") as bag:                                             # doctest: +SKIP
    ...     bag.add_topic("/stage_x/samples", "sensor_msgs/msg/PointCloud2")
    ...     bag.write("/stage_x/samples", node.get_clock().now().nanoseconds, raw)
    """

    def __init__(self, path: str | Path) -> None:
        self.path = in_home(path)
        self._file = self.path / f"{self.path.name}_0.mcap"
        self._typestore = get_typestore(Stores.ROS2_KILTED)
        self._schemas: dict[str, int] = {}
        self._channels: dict[str, int] = {}
        self._topics: dict[str, dict[str, Any]] = {}
        self._counts: dict[str, int] = {}
        self._first = self._last = 0
        self._waiting: list[tuple[int, int, bytes, int, int]] = []
        self._waiting_bytes = 0
        with naming(self.path, _EXPECTED):
            self.path.mkdir(parents=True)
            self._stream = self._file.open("xb")
            self._mcap = Writer(self._stream, chunk_size=CHUNK_BYTES, compression=CompressionType.NONE)
            self._mcap.start(profile="ros2", library="piezo_hysteresis")
            self._write_metadata()
            self._mcap.flush()
        self._flushed = time.monotonic()
        self._open = True

    def __enter__(self) -> BagWriter:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def add_topic(
        self, name: str, type: str, *, depth: int = 100, reliable: bool = True, transient_local: bool = False
    ) -> BagWriter:
        """Add a topic; required before its first message.

        Parameters
        ----------
        name : str
            Absolute topic name.
        type : str
            Message type, e.g. ``"std_msgs/msg/String"``.
        depth, reliable, transient_local
            Quality of service of the publisher, with which ``ros2 bag play`` offers the topic again.

        Returns
        -------
        BagWriter
            Itself.

        Raises
        ------
        RecordingError
            On a type that is not part of a ROS 2 installation, or a topic announced with two types.
        """
        if name in self._topics:
            if self._topics[name]["type"] != type:
                raise RecordingError(f"{name}: got type {type}, expected {self._topics[name]['type']} as before")
            return self
        if type not in self._typestore.types:
            raise RecordingError(f"{name}: got message type '{type}', expected one of a ROS 2 installation")
        self._check_open()
        qos = _qos(depth, reliable, transient_local)
        with self._ending_on_failure():
            if type not in self._schemas:
                definition, _ = self._typestore.generate_msgdef(type, ros_version=2)
                self._schemas[type] = self._mcap.register_schema(type, "ros2msg", definition.encode())
            self._channels[name] = self._mcap.register_channel(
                name, "cdr", self._schemas[type], {"offered_qos_profiles": yaml.safe_dump(qos, sort_keys=False)}
            )
        self._topics[name] = {
            "name": name,
            "type": type,
            "serialization_format": "cdr",
            "offered_qos_profiles": qos,
            "type_description_hash": self._typestore.hash_rihs01(type),
        }
        self._counts[name] = 0
        return self

    def write(self, topic: str, time_ns: int, message: bytes | memoryview) -> None:
        """Append one serialised message.

        Parameters
        ----------
        topic : str
            A topic that was added.
        time_ns : int
            Time of reception [ns].
        message : bytes
            CDR with its encapsulation header, as a raw subscription delivers it.

        Raises
        ------
        RecordingError
            On an unknown topic, after `close`, or if the disk cannot store the message.
        """
        self._check_open()
        if topic not in self._channels:
            raise RecordingError(f"{self.path}: topic '{topic}' was not added; expected one of {list(self._channels)}")
        count = self._counts[topic]
        self._waiting.append((self._channels[topic], time_ns, bytes(message), time_ns, count))
        self._waiting_bytes += len(message)
        self._counts[topic] = count + 1
        self._first = min(self._first, time_ns) if self._last else time_ns
        self._last = max(self._last, time_ns)
        if self._waiting_bytes >= CHUNK_BYTES or time.monotonic() - self._flushed >= FLUSH_INTERVAL:
            self.flush()

    def flush(self) -> None:
        """Pass all messages so far to the operating system, so that they survive a kill of this process."""
        self._check_open()
        with self._ending_on_failure():
            self._write_chunk()
            check_in_place(self._stream, self._file)
        self._flushed = time.monotonic()

    def close(self) -> None:
        """Write the index and the metadata; a second call does nothing."""
        if not self._open:
            return
        with self._ending_on_failure():
            self._write_chunk()
            self._mcap.add_metadata("rosbag2", {"serialized_metadata": yaml.safe_dump(self._information())})
            self._mcap.finish()
            self._stream.close()
            self._write_metadata()
        self._open = False

    def _write_chunk(self) -> None:
        """Write all waiting chunks together, which is faster than one after the other."""
        waiting, self._waiting, self._waiting_bytes = self._waiting, [], 0
        for message in waiting:
            self._mcap.add_message(*message)
        self._mcap.flush()

    def _check_open(self) -> None:
        if not self._open:
            raise RecordingError(f"{self.path}: the recording has ended; start another bag")

    @contextmanager
    def _ending_on_failure(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            self._open = False
            with suppress(OSError):  # closing flushes once more what the disk has just refused
                self._stream.close()
            raise RecordingError(f"{self.path}: {error.strerror or error}; the recording ended") from error

    def _write_metadata(self) -> None:
        draft = self.path / "metadata.yaml.tmp"
        draft.write_text(yaml.safe_dump({"rosbag2_bagfile_information": self._information()}, sort_keys=False))
        draft.replace(self.path / "metadata.yaml")

    def _information(self) -> dict[str, Any]:
        span = {
            "duration": {"nanoseconds": self._last - self._first},
            "starting_time": {"nanoseconds_since_epoch": self._first},
            "message_count": sum(self._counts.values()),
        }
        return {
            "version": 9,
            "storage_identifier": "mcap",
            "relative_file_paths": [self._file.name],
            **span,
            "topics_with_message_count": [
                {"topic_metadata": topic, "message_count": self._counts[name]} for name, topic in self._topics.items()
            ],
            "compression_format": "",
            "compression_mode": "",
            "files": [{"path": self._file.name, **span}],
            "custom_data": None,
            "ros_distro": "kilted",
        }


def _qos(depth: int, reliable: bool, transient_local: bool) -> list[dict[str, Any]]:
    return [
        {
            "history": "keep_last",
            "depth": depth,
            "reliability": "reliable" if reliable else "best_effort",
            "durability": "transient_local" if transient_local else "volatile",
            "deadline": dict(_FOREVER),
            "lifespan": dict(_FOREVER),
            "liveliness": "automatic",
            "liveliness_lease_duration": dict(_FOREVER),
            "avoid_ros_namespace_conventions": False,
        }
    ]
