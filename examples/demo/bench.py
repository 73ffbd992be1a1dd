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

"""`Bench`: access to the stage as a user has it: services, waveforms, the live residual. It uses ROS messages only."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from diagnostic_msgs.msg import DiagnosticStatus
from numpy.typing import NDArray
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import Float64, String
from std_srvs.srv import Trigger

from piezo_hysteresis import Model
from piezo_hysteresis.acquisition.sample_block import SampleBlock
from piezo_hysteresis.model.model_file import loads
from piezo_hysteresis.model.model_parameters import hash_number
from piezo_hysteresis.nodes.compensation.trajectory import trajectory_to_cloud
from piezo_hysteresis.nodes.messages.cloud import from_cloud
from piezo_hysteresis.nodes.messages.conversions import command_to_cloud, values_of
from piezo_hysteresis.nodes.messages.samples import SampleReader
from piezo_hysteresis.nodes.runtime.qos import COMMAND, COMMAND_STATUS, LATCHED, SAMPLES, STATUS
from piezo_hysteresis.nodes.topics import TOPICS

Array = NDArray[np.float64]

SERVICES = {
    "identification_node": ("plan", "identify", "diagnose"),
    "compensation_node": ("learn",),
    "model_node": ("zero",),
}
"""Services that are called, by node."""
KEPT = 3000
"""Blocks of samples that are kept: half a minute."""


@dataclass
class Trace:
    """Output of the model node while a waveform was played.

    Attributes
    ----------
    time : (n,) ndarray
        Time since the first sample of the waveform, of every sample that arrived [s].
    residual : (n,) ndarray
        Measured minus predicted displacement [m].
    live_rms : list of float
        Values of `residual_rms` meanwhile [m].
    """

    time: Array
    residual: Array
    live_rms: list[float]

    @property
    def rms(self) -> float:
        """RMS residual over the whole waveform [m]."""
        return float(np.sqrt(np.mean(self.residual**2)))


class Recording:
    """The newest samples of the driver, as they arrived."""

    def __init__(self) -> None:
        self._reader = SampleReader()
        self._blocks: deque[SampleBlock] = deque(maxlen=KEPT)

    def take(self, message: bytes) -> None:
        """Add a message of `samples`."""
        self._blocks.append(self._reader.read(message))

    def holds(self, index: int) -> bool:
        """Whether the sample with this index, or a later one, has arrived."""
        return bool(self._blocks) and (int(self._blocks[-1].index[-1]) - index) % 2**32 < 2**31

    def displacement(self, first: int, size: int) -> Array:
        """Displacement of `size` samples from index `first` on, NaN where one was lost on the way [m]."""
        found = np.full(size, np.nan)
        for block in self._blocks:
            number = block.index - np.uint32(first % 2**32)
            inside = number < size
            found[number[inside]] = block.displacement[inside]
        return found


class Bench:
    """Client of the nodes in one namespace.

    Parameters
    ----------
    namespace : str
        Of the nodes.
    sample_period : float
        Of the driver [s].
    check : callable
        Called while waiting; raises where a node has died.
    """

    def __init__(self, namespace: str, sample_period: float, check: Callable[[], None]) -> None:
        self._sample_period, self._check = sample_period, check
        self.node = Node("demo", namespace=namespace)
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self.node)
        self.status: DiagnosticStatus | None = None
        self.models: list[str] = []
        self._blocks: list[tuple[NDArray[np.uint32], Array]] | None = None
        self._live_rms: list[float] = []
        self._followed: int | None = None
        self._ended: dict[str, DiagnosticStatus] = {}
        self._driven: list[DiagnosticStatus] = []
        self._samples = Recording()
        self._command = self.node.create_publisher(PointCloud2, "command", COMMAND)
        self._trajectory = self.node.create_publisher(PointCloud2, "trajectory", COMMAND)
        subscribe = self.node.create_subscription
        subscribe(DiagnosticStatus, "status", self._on_status, STATUS)
        subscribe(DiagnosticStatus, "command_status", self._on_command_status, COMMAND_STATUS)
        subscribe(String, "model", lambda message: self.models.append(message.data), LATCHED)
        subscribe(Float64, "residual_rms", self._on_rms, COMMAND)
        subscribe(PointCloud2, "predicted_samples", self._on_predicted, SAMPLES)
        subscribe(PointCloud2, "samples", self._samples.take, TOPICS["samples"].deep, raw=True)
        self._services = {
            service: self.node.create_client(Trigger, f"{owner}/{service}")
            for owner, services in SERVICES.items()
            for service in services
        }

    def _on_status(self, status: DiagnosticStatus) -> None:
        """Two nodes publish on `status`."""
        if "compensation_node" in status.name:
            self._driven.append(status)
        else:
            self.status = status

    def _on_command_status(self, status: DiagnosticStatus) -> None:
        if values_of(status)["state"] in ("refused", "done", "stopped"):
            self._ended[status.name] = status

    def _on_rms(self, message: Float64) -> None:
        self._live_rms.append(message.data)

    def _on_predicted(self, cloud: PointCloud2) -> None:
        columns = from_cloud(cloud, {"index": "u4", "residual": "f8", "model": "u4"})
        self._followed = int(columns["model"][-1])
        if self._blocks is not None:
            self._blocks.append((columns["index"], columns["residual"]))

    def until(self, done: Callable[[], bool], what: str, timeout: float) -> Iterator[None]:
        """Spin until `done`, giving control back ten times a second.

        Raises
        ------
        TimeoutError
            If it takes longer than `timeout` [s].
        """
        end = time.monotonic() + timeout
        while not done():
            if time.monotonic() > end:
                raise TimeoutError(f"{what}: nothing after {timeout:g} s")
            self._check()
            tick = time.monotonic() + 0.1
            while time.monotonic() < tick:
                self._executor.spin_once(timeout_sec=0.02)
            yield

    def wait(self, done: Callable[[], bool], what: str, timeout: float) -> None:
        """Spin until `done`."""
        for _ in self.until(done, what, timeout):
            pass

    def new_model(self, before: int) -> Model:
        """The model published after the first `before` ones, once the model node predicts with it."""
        self.wait(lambda: len(self.models) > before, "a new model", 60.0)
        model = loads(self.models[-1])
        self.wait(lambda: self._followed == hash_number(model), "the model node to use it", 60.0)
        return model

    def pause(self, duration: float) -> None:
        """Spin for `duration` [s]."""
        end = time.monotonic() + duration
        self.wait(lambda: time.monotonic() > end, "the end of a pause", 2.0 * duration + 10.0)

    def call(self, service: str) -> Trigger.Response:
        """Call a service of a node, which answers at once."""
        client = self._services[service]
        self.wait(client.service_is_ready, f"service {service}", 60.0)
        future = client.call_async(Trigger.Request())
        self.wait(future.done, f"answer of {service}", 30.0)
        return future.result()

    def play(self, voltage: Array, name: str, timeout: float = 120.0) -> Trace:
        """Play a waveform [V] and listen to the model node meanwhile.

        Raises
        ------
        RuntimeError
            If the driver does not play it to its end.
        TimeoutError
            If the waveform, or its prediction, takes too long.
        """
        self._live_rms = []
        self.wait(lambda: bool(self._live_rms), "a prediction by the model node", 60.0)
        self._blocks, self._live_rms = [], []
        first = self._send(voltage, name, timeout)
        last = (first + voltage.size - 1) % 2**32
        self.wait(lambda: self._seen(last), "the prediction of the last sample", 30.0)
        index, residual = (np.concatenate(column) for column in zip(*self._blocks, strict=True))
        number = index - np.uint32(first)
        inside = number < voltage.size
        live, self._blocks = self._live_rms, None
        return Trace(self._sample_period * number[inside], residual[inside], live)

    def play_measured(self, voltage: Array, name: str, timeout: float = 120.0) -> Array:
        """Play a waveform [V] and return the displacement of every sample, shape as `voltage` [m]; NaN: lost.

        Raises
        ------
        RuntimeError
            If the driver does not play it to its end.
        TimeoutError
            If that takes too long.
        """
        return self.measured(self._send(voltage, name, timeout), voltage.size)

    def follow(self, wanted: Array, name: str, timeout: float = 120.0) -> DiagnosticStatus:
        """Send a path [m] to the compensation node, and wait until it was played or refused; its last status."""
        self.wait(lambda: self._trajectory.get_subscription_count() > 0, "a compensation node", 60.0)
        self._driven.clear()
        stamp = self.node.get_clock().now().to_msg()
        self._trajectory.publish(trajectory_to_cloud(wanted, name, stamp))
        return self._driven_to_end(name, timeout)

    def learn(self, timeout: float = 120.0) -> tuple[DiagnosticStatus, DiagnosticStatus]:
        """Let the compensation node play the last path in rounds; its status after the best of them, and at the end.

        Raises
        ------
        RuntimeError
            If it does not.
        """
        self._driven.clear()
        answer = self.call("learn")
        if not answer.success:
            raise RuntimeError(f"learn: {answer.message}")
        end = self._driven_to_end("", timeout)
        rounds = [status for status in self._driven if values_of(status)["state"] == "learning"]
        return min(rounds, key=lambda status: float(values_of(status)["rms"]), default=end), end

    def measured(self, first: int, size: int) -> Array:
        """Displacement of `size` samples from index `first` on, NaN where one was lost on the way [m]."""
        self.wait(lambda: self._samples.holds(first + size - 1), "the last sample", 30.0)
        return self._samples.displacement(first, size)

    def _driven_to_end(self, name: str, timeout: float) -> DiagnosticStatus:
        def ended() -> DiagnosticStatus | None:
            ends = ("done", "refused", "failed", "stopped")
            own = [s for s in self._driven if values_of(s)["state"] in ends and name in ("", values_of(s)["phase"])]
            return own[-1] if own else None

        self.wait(lambda: ended() is not None, f"the end of '{name or 'learning'}'", timeout)
        found = ended()
        assert found is not None
        return found

    def _send(self, voltage: Array, name: str, timeout: float) -> int:
        """Play a waveform; the index of its first sample."""
        self.wait(lambda: self._command.get_subscription_count() > 0, "a driver", 60.0)
        self._ended.pop(name, None)
        stamp = self.node.get_clock().now().to_msg()
        self._command.publish(command_to_cloud(voltage, self._sample_period, name, stamp))
        self.wait(lambda: name in self._ended, f"end of '{name}'", timeout)
        values = values_of(self._ended[name])
        if values["state"] != "done":
            raise RuntimeError(f"the driver did not play '{name}': {values['state']}, {self._ended[name].message}")
        return int(values["first_index"])

    def _seen(self, index: int) -> bool:
        return bool(self._blocks) and (int(self._blocks[-1][0][-1]) - index) % 2**32 < 2**31
