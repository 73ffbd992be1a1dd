"""`BagRecorder`: every topic of an axis, message by message as it came over the wire, into a bag."""

from __future__ import annotations

import time
from collections.abc import Collection
from pathlib import Path

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState, PointCloud2
from std_msgs.msg import Float64, String

from ...errors import RecordError, RecordingError
from ...recording import BagWriter
from ..messages.samples import SampleReader
from ..runtime.node_clock import now
from ..runtime.qos import COMMAND, COMMAND_STATUS, DEEP, LATCHED, SAMPLES

TOPICS = {
    "samples": (PointCloud2, SAMPLES),
    "predicted_samples": (PointCloud2, SAMPLES),
    "command": (PointCloud2, COMMAND),
    "command_status": (DiagnosticStatus, COMMAND_STATUS),
    "phase": (String, LATCHED),
    "model": (String, LATCHED),
    "status": (DiagnosticStatus, LATCHED),
    "set_voltage": (Float64, COMMAND),
    "voltage": (Float64, COMMAND),
    "displacement": (Float64, COMMAND),
    "prediction": (Float64, COMMAND),
    "residual": (Float64, COMMAND),
    "residual_rms": (Float64, COMMAND),
    "live": (JointState, COMMAND),
    "predicted_live": (JointState, COMMAND),
    "/diagnostics": (DiagnosticArray, QoSProfile(depth=10)),
}
"""Topics of an axis: type and quality of service."""


class BagRecorder:
    """Subscribes to topics of an axis and writes what comes, until it is closed.

    Parameters
    ----------
    node : rclpy.node.Node
        Whose namespace and executor are used.
    path : Path
        Folder of the bag, which must not exist.
    topics : collection of str
        Some of `TOPICS`; all of them by default.

    Attributes
    ----------
    counts : dict of str to int
        Messages written so far by topic.
    failure : RecordingError or None
        What ended the recording early.

    Raises
    ------
    RecordingError
        If the bag cannot be made.
    """

    def __init__(self, node: Node, path: Path, topics: Collection[str] = TOPICS) -> None:
        self._node, self._bag = node, BagWriter(path)
        self.counts = dict.fromkeys(topics, 0)
        self.failure: RecordingError | None = None
        self._last = time.monotonic()
        self._newest, self._reader = b"", SampleReader()
        self._subscriptions = [self._subscribe(name) for name in topics]

    @property
    def silence(self) -> float:
        """Time since the last block of samples [s]."""
        return time.monotonic() - self._last

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
        """End the bag; harmless when repeated."""
        while self._subscriptions:
            self._node.destroy_subscription(self._subscriptions.pop())
        self._bag.close()

    def _subscribe(self, name: str) -> object:
        kind, quality = TOPICS[name]
        topic = self._node.resolve_topic_name(name)
        self._bag.add_topic(
            topic,
            f"{kind.__module__.split('.')[0]}/msg/{kind.__name__}",
            depth=quality.depth,
            reliable=quality.reliability == ReliabilityPolicy.RELIABLE,
            transient_local=quality.durability == DurabilityPolicy.TRANSIENT_LOCAL,
        )
        deep = QoSProfile(depth=DEEP.depth, reliability=quality.reliability, durability=quality.durability)

        def write(message: bytes) -> None:
            self._write(name, topic, message)

        return self._node.create_subscription(kind, topic, write, deep, raw=True)

    def _write(self, name: str, topic: str, message: bytes) -> None:
        if name == "samples":
            self._last, self._newest = time.monotonic(), message
        if self.failure is not None:
            return
        try:
            self._bag.write(topic, now(self._node), message)
        except RecordingError as error:
            self.failure = error
        self.counts[name] += 1
