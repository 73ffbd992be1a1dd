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

"""`Keeper`: receives everything in the soak and counts samples that were sent, received, or wrong."""

from __future__ import annotations

import threading
import time
from collections import Counter
from pathlib import Path

import numpy as np
import rclpy
from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.client import Client
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import PointCloud2

from benchmarks.soak_processes import NAMESPACE
from piezo_hysteresis.acquisition.sample_block import SampleBlock
from piezo_hysteresis.errors import PiezoError
from piezo_hysteresis.nodes.messages.cloud import from_cloud
from piezo_hysteresis.nodes.messages.conversions import command_to_cloud, values_of
from piezo_hysteresis.nodes.messages.samples import PREDICTED_SAMPLES, samples_from_cloud
from piezo_hysteresis.nodes.runtime.qos import COMMAND, COMMAND_STATUS
from piezo_hysteresis.recording import Bag

LOST = "samples lost on the way to the keeper, according to the index"
BEFORE = "samples before the keeper had found the driver, according to the index"
DEEP = QoSProfile(depth=5000, reliability=ReliabilityPolicy.RELIABLE)


class Keeper:
    """A node in a thread of its own.

    Parameters
    ----------
    false : float
        Residual beyond which a prediction is false [m].
    tolerance : float
        Difference between a voltage commanded and applied that is none [V].
    """

    def __init__(self, false: float, tolerance: float) -> None:
        self._false, self._tolerance = false, tolerance
        self.node = Node("keeper", namespace=NAMESPACE)
        self.counts: Counter[str] = Counter()
        self.broken: list[str] = []
        self.newest = -1
        self.predicted = -1
        self.is_good = False
        self.state: dict[str, tuple[str, int]] = {}
        self._commands: dict[int, np.ndarray] = {}
        self._firsts: dict[int, int] = {}
        self._access = threading.Lock()
        self._sender = self.node.create_publisher(PointCloud2, "command", COMMAND)
        self.node.create_subscription(PointCloud2, "samples", self._on_samples, DEEP)
        self.node.create_subscription(PointCloud2, "predicted_samples", self._on_predicted, DEEP)
        self.node.create_subscription(DiagnosticStatus, "command_status", self._on_status, COMMAND_STATUS)
        self._clients: dict[str, Client] = {}
        self._publishers: dict[str, Publisher] = {}
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self.node)
        self._thread = threading.Thread(target=self._executor.spin, daemon=True)
        self._waveforms: dict[str, np.ndarray] = {}
        self._thread.start()

    def send(self, waveform: np.ndarray, name: str, sample_period: float) -> None:
        """Send a command that is followed to its end."""
        self._waveforms[name] = waveform
        self.counts["commands sent"] += 1
        self._sender.publish(command_to_cloud(waveform, sample_period, name, self.node.get_clock().now().to_msg()))

    def client(self, kind: type, name: str) -> Client:
        """A client of a service, kept for ever: what another thread spins cannot be taken away."""
        if name not in self._clients:
            self._clients[name] = self.node.create_client(kind, name)
        self._clients[name].wait_for_service(5.0)
        return self._clients[name]

    def publisher(self, kind: type, name: str, quality: QoSProfile) -> Publisher:
        """A publisher on a topic, kept for ever, that has had time to be found."""
        if name not in self._publishers:
            self._publishers[name] = self.node.create_publisher(kind, name, quality)
            time.sleep(0.5)
        return self._publishers[name]

    def fate(self, name: str) -> str:
        """State of a command; empty before the driver reported one."""
        return self.state.get(name, ("", 0))[0]

    def break_promise(self, what: str) -> None:
        """Note a promise that was not kept."""
        self.counts["promises broken"] += 1
        if len(self.broken) < 50:
            self.broken.append(what)

    def _on_samples(self, cloud: PointCloud2) -> None:
        try:
            block = samples_from_cloud(cloud)
        except PiezoError:
            return  # one of those that the soak itself publishes
        first, last = int(block.index[0]), int(block.index[-1])
        with self._access:
            if first <= self.newest:  # another driver: its numbers begin again
                self.newest = -1
                self._commands.clear()
            if first > self.newest + 1:
                self.counts[LOST if self.newest >= 0 else BEFORE] += first - self.newest - 1
            self.newest = last
            self.counts["samples received"] += block.size
            for number in np.unique(block.phase).tolist():
                self._compare(block, number)

    def _compare(self, block: SampleBlock, number: int) -> None:
        """A sample of a command against what was commanded."""
        values = self._commands.get(number)
        if values is None:
            return
        inside = block.phase == number
        at = block.index[inside].astype(np.int64) - self._firsts[number]
        if (at < 0).any() or (at >= values.size).any():
            self.break_promise(f"phase {number} has samples outside its command")
            return
        wrong = np.abs(block.voltage[inside] - values[at]) > self._tolerance
        self.counts["samples of commands compared"] += int(inside.sum())
        if wrong.any():
            self.break_promise(f"phase {number}: {int(wrong.sum())} samples were not played as commanded")

    def _on_status(self, status: DiagnosticStatus) -> None:
        values = values_of(status)
        self.state[status.name] = (values["state"], int(values.get("first_index") or 0))
        self.counts[f"commands {values['state']}"] += 1
        if values["state"] == "playing" and status.name in self._waveforms:
            with self._access:
                self._commands[int(values["phase"])] = self._waveforms[status.name]
                self._firsts[int(values["phase"])] = int(values["first_index"])

    def _on_predicted(self, cloud: PointCloud2) -> None:
        columns = from_cloud(cloud, PREDICTED_SAMPLES)
        size, worst = columns["index"].size, float(np.abs(columns["residual"]).max())
        self.predicted = int(columns["index"][-1])
        self.counts["samples predicted"] += size
        self.is_good = bool(cloud.is_dense)
        if not cloud.is_dense:
            self.counts["predictions marked as not reliable"] += size
        elif worst > self._false:
            self.counts["false predictions published as good"] += size
            self.break_promise(f"prediction {self.predicted} is off by {worst * 1e9:.0f} nm and published as good")

    def missing(self, bag: Path, killed: float) -> int:
        """Blocks that a recorder had recorded a second before it was `killed` [s] and that are not in its bag."""
        rows = np.fromfile(f"{bag}.progress").reshape(-1, 2)
        before = rows[rows[:, 0] <= killed - 1.0, 1]
        held = sum(1 for _ in Bag(bag).messages({f"{NAMESPACE}/samples"}))
        self.counts["blocks recorded by recorders that were killed"] += held
        return int(before[-1]) - held if before.size else 0

    def close(self) -> None:
        """Leave the graph."""
        self._executor.shutdown()
        self._thread.join(5.0)
        self.node.destroy_node()
        rclpy.try_shutdown()
