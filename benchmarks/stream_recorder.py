"""`StreamRecorder`: the third process of the streaming benchmark, which sends waveforms and records."""

from __future__ import annotations

import time
from collections.abc import Callable, Collection
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.executors import Executor
from rclpy.node import Node
from rclpy.task import Future
from sensor_msgs.msg import PointCloud2

from piezo_hysteresis.nodes.bag_recorder import BagRecorder
from piezo_hysteresis.nodes.conversions import command_to_cloud, values_of
from piezo_hysteresis.nodes.quality import COMMAND, COMMAND_STATUS

PATIENCE = 60.0
CATCH_UP = 5.0
"""What the model node may be behind at the end [s]; what comes later counts as lost."""


_LOOK = 0.05
"""Time between two looks at what is waited for [s]."""


@dataclass
class Command:
    """A waveform that was played, and the index of its first sample."""

    voltage: np.ndarray
    first: int


class StreamRecorder:
    """Sends waveforms, and records an axis.

    Parameters
    ----------
    namespace : str
        Of the axis.
    folder : pathlib.Path
        For the bag.
    executor : Executor
        That of all axes.
    check : callable
        Raises where a node has ended.
    topics : collection of str
        What is recorded.
    """

    def __init__(
        self, namespace: str, folder: Path, executor: Executor, check: Callable[[], None], topics: Collection[str]
    ) -> None:
        self._check, self._executor = check, executor
        self._node = Node("recorder", namespace=namespace)
        self._executor.add_node(self._node)
        self._never = Future()
        self._ended: dict[str, dict[str, str]] = {}
        self._command = self._node.create_publisher(PointCloud2, "command", COMMAND)
        self._node.create_subscription(DiagnosticStatus, "command_status", self._on_status, COMMAND_STATUS)
        self.bag = BagRecorder(self._node, folder, topics)

    def _on_status(self, status: DiagnosticStatus) -> None:
        told = values_of(status)
        if told["state"] in ("refused", "stopped", "done"):
            self._ended[status.name] = {**told, "reason": status.message}

    def wait(self, done: Callable[[], bool], what: str, timeout: float = PATIENCE) -> None:
        """Spin until `done`."""
        end = time.monotonic() + timeout
        while not done():
            self._executor.spin_until_future_complete(self._never, timeout_sec=_LOOK)
            if time.monotonic() > end:
                raise TimeoutError(f"{what}: nothing after {timeout:g} s")
            self._check()

    def pause(self, duration: float) -> None:
        """Spin for a while [s]."""
        end = time.monotonic() + duration
        self.wait(lambda: time.monotonic() > end, "the end of a pause", duration + PATIENCE)

    def send(self, voltage: np.ndarray, sample_period: float, name: str) -> None:
        """Have a waveform played; without a stamp, for where no core is free it may be old when it comes."""
        self.wait(lambda: self._command.get_subscription_count() > 0, "the driver")
        self._command.publish(command_to_cloud(voltage, sample_period, name))

    def played(self, voltage: np.ndarray, sample_period: float, name: str) -> Command:
        """Spin until it has been played to its end."""
        self.wait(lambda: name in self._ended, f"the end of {name}", voltage.size * sample_period + PATIENCE)
        told = self._ended[name]
        if told["state"] != "done":
            raise RuntimeError(f"the driver did not play {name}: {told['reason']}")
        return Command(voltage, int(told["first_index"]))

    def follow(self, command: Command) -> None:
        """Spin until the samples of a command have been recorded and the model node had its time to catch up."""
        last = (command.first + command.voltage.size - 1) % 2**32
        self.wait(lambda: self.bag.holds(last), "the last sample")
        caught_up, end = self.bag.counts["samples"], time.monotonic() + CATCH_UP
        while self.bag.counts["predicted_samples"] < caught_up and time.monotonic() < end:
            self.pause(0.1)

    def close(self) -> None:
        """End the bag and leave the graph."""
        self.bag.close()
        self._node.destroy_node()
