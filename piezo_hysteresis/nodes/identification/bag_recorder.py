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

"""`BagRecorder`: records all topics of an axis as serialised messages in a bag."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path

from rclpy.node import Node
from rclpy.qos import ReliabilityPolicy

from ...errors import RecordError, RecordingError, reason_of
from ...recording import BagWriter
from ..messages.samples import SampleReader
from ..runtime.node_clock import now
from ..topics import TOPICS, subscribe


class BagRecorder:
    """Subscribes to topics of an axis and writes every message, until it is closed.

    Parameters
    ----------
    node : rclpy.node.Node
        Node with the namespace and the executor that are used.
    path : Path
        Folder of the bag, which must not exist.
    topics : collection of str
        Some of `TOPICS`; all of them by default.

    Attributes
    ----------
    counts : dict of str to int
        Number of messages written so far, by topic.
    failure : RecordingError or None
        Error that ended the recording early.

    Raises
    ------
    RecordingError
        If the bag cannot be made.
    """

    def __init__(self, node: Node, path: Path, topics: Collection[str] = TOPICS) -> None:
        self._node, self._bag = node, BagWriter(path)
        self.counts = dict.fromkeys(topics, 0)
        self.failure: RecordingError | None = None
        self._newest, self._reader = b"", SampleReader()
        self._subscriptions = [self._subscribe(name) for name in topics]

    def holds(self, index: int) -> bool:
        """True where the newest sample written is number `index` (modulo 2³²) or a later one."""
        if not self._newest:
            return False
        try:
            newest = int(self._reader.read(self._newest).index[-1])
        except RecordError:
            return False
        return (newest - index) % 2**32 < 2**31

    def close(self) -> None:
        """Close the bag; may be repeated."""
        while self._subscriptions:
            self._node.destroy_subscription(self._subscriptions.pop())
        self._bag.close()

    def _subscribe(self, name: str) -> object:
        described = TOPICS[name]
        # readers look for a topic under its own name, whatever it is remapped to
        topic, quality = self._node.resolve_topic_name(name, only_expand=True), described.quality
        self._bag.add_topic(
            topic,
            described.type_name,
            depth=quality.depth,
            reliable=quality.reliability == ReliabilityPolicy.RELIABLE,
            transient_local=described.is_latched,
        )

        def write(message: bytes) -> None:
            self._write(name, topic, message)

        return subscribe(self._node, name, write, deep=True, raw=True)

    def _write(self, name: str, topic: str, message: bytes) -> None:
        if name == "samples":
            self._newest = message
        if self.failure is not None:
            return
        try:
            self._bag.write(topic, now(self._node), message)
        except RecordingError as error:
            self.failure = RecordingError(f"{error}; its part before that is readable")
        except Exception as error:
            self.failure = RecordingError(f"the recording ended: {reason_of(error)}")
        self.counts[name] += 1
