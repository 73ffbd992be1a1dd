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

"""`Lab`: a node of the test's own, the node processes that it starts, and what it hears from them."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rclpy
import yaml
from ament_index_python.packages import PackageNotFoundError, get_package_prefix
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from lifecycle_msgs.srv import ChangeState, GetState
from rcl_interfaces.srv import GetParameters
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import String
from std_srvs.srv import Trigger

from piezo_hysteresis.acquisition.sample_block import SampleBlock
from piezo_hysteresis.nodes.messages.conversions import command_to_cloud, values_of
from piezo_hysteresis.nodes.messages.samples import samples_from_cloud
from piezo_hysteresis.nodes.runtime.guarded_node import GuardedNode
from piezo_hysteresis.nodes.runtime.qos import COMMAND, COMMAND_STATUS, LATCHED

from .forked_node import ForkedNode

PATIENCE = 60.0

FORKED = ("driver_node", "model_node", "axes_model_node", "identification_node", "compensation_node")
"""Executables that start as a fork of a process that has imported them."""

DEEP = QoSProfile(depth=5000, reliability=ReliabilityPolicy.RELIABLE)
"""A test that is kept waiting by a busy machine shall not lose blocks on its own account."""


class NodeProcess:
    """A node of the package as a process, its output in a file."""

    def __init__(self, command: list[str], environment: dict[str, str], log: Path, forked: bool) -> None:
        self._log = log
        log.touch()  # a forked node opens it only when the server has started
        self._process: ForkedNode | subprocess.Popen[bytes]
        if forked:
            self._process = ForkedNode(command, environment, log)
        else:
            with log.open("wb") as output:
                self._process = subprocess.Popen(command, env=environment, stdout=output, stderr=subprocess.STDOUT)
        self.pid = self._process.pid

    @property
    def output(self) -> str:
        return self._log.read_text(errors="replace")

    @property
    def is_running(self) -> bool:
        return self._process.poll() is None

    @property
    def is_importing(self) -> bool:
        """True once the entry point of the package is at work: what comes before is Python's own."""
        try:
            return "rclpy" in Path(f"/proc/{self.pid}/maps").read_text()
        except OSError:
            return False

    def signal(self, number: signal.Signals) -> None:
        self._process.send_signal(number)

    def wait(self, timeout: float = PATIENCE) -> int:
        return self._process.wait(timeout)

    def end(self) -> None:
        if self.is_running:
            self.signal(signal.SIGCONT)
            self.signal(signal.SIGINT)
            try:
                self.wait(10.0)
            except subprocess.TimeoutExpired:
                self._process.kill()
                self._process.wait()


class Samples:
    """Everything that came in on a topic like `samples`, in order."""

    def __init__(self) -> None:
        self.blocks: list[SampleBlock] = []

    def take(self, cloud: PointCloud2) -> None:
        self.blocks.append(samples_from_cloud(cloud))

    def __getattr__(self, name: str) -> np.ndarray:
        return np.concatenate([getattr(block, name) for block in list(self.blocks)])

    def so_far(self) -> Samples:
        """What has come in until now; blocks go on arriving in another thread."""
        part = Samples()
        part.blocks = list(self.blocks)
        return part

    @property
    def newest(self) -> SampleBlock:
        """The last block."""
        return self.blocks[-1]

    @property
    def lost(self) -> int:
        """Number of samples that the jumps of the index skip: never measured, or lost on the way."""
        return int((np.diff(self.place()) - 1).sum())

    def place(self) -> np.ndarray:
        """Number of every sample, int64."""
        return self.index.astype(np.int64)

    def steepest(self, sample_period: float) -> float:
        """Steepest change of the voltage between two samples that came in [V/s]."""
        return float((np.abs(np.diff(self.voltage)) / np.diff(self.place())).max()) / sample_period

    def played(self, waveform: np.ndarray, first: int, number: int) -> bool:
        """True where phase `number` is the waveform from index `first` on, but for samples that were lost."""
        part = self.so_far()
        inside = part.phase == number
        at = part.place()[inside] - first
        whole = inside.sum() + part.lost >= len(waveform)
        return whole and np.array_equal(part.voltage[inside], np.asarray(waveform)[at])


class LabNode(GuardedNode):
    """A node of the test's own: what its callbacks raise ends the test."""

    def fault(self, error: Exception) -> None:
        raise error


class Spinning:
    """An executor that spins nodes in a thread of its own until it is ended: only then may they be destroyed."""

    def __init__(self, context: rclpy.Context, node: Node) -> None:
        self.executor = SingleThreadedExecutor(context=context)
        self.executor.add_node(node)
        self._ended = rclpy.Future()
        self._thread = threading.Thread(
            target=self.executor.spin_until_future_complete, args=(self._ended,), daemon=True
        )
        self._thread.start()

    def end(self) -> None:
        self._ended.set_result(None)
        self._thread.join(PATIENCE)
        if self._thread.is_alive():
            pytest.fail(f"the thread of the test's own node did not end within {PATIENCE:g} s")
        self.executor.shutdown()


class Lab:
    """A node of the test's own in a thread, and the processes that it has started."""

    def __init__(self, domain: int, folder: Path) -> None:
        self.domain, self.folder = domain, folder
        self.processes: list[NodeProcess] = []
        self._added: list[Any] = []
        self._heard: list[Any] = []
        self._clients: dict[str, tuple[Any, Any]] = {}
        self._others: list[tuple[Node, Spinning]] = []
        self._context = rclpy.Context()
        rclpy.init(context=self._context, domain_id=domain)
        self.node = LabNode("lab", context=self._context)
        self._spinning = Spinning(self._context, self.node)

    def start(
        self,
        executable: str,
        *arguments: str,
        namespace: str = "",
        environment: dict[str, str] | None = None,
        program: list[str] | None = None,
        fresh: bool = False,
        **parameters: Any,
    ) -> NodeProcess:
        """Start ``driver_node``, ``model_node`` or ``identification_node``; '__' in a parameter name means '.'.

        A `program` of the test's own takes the place of the executable. A `fresh` process starts with an interpreter of
        its own: for tests of what happens while a node starts.
        """
        number = len(self.processes)
        values = {name.replace("__", "."): value for name, value in parameters.items()}
        file = self.folder / f"parameters_{number}.yaml"
        file.write_text(yaml.safe_dump({"/**": {"ros__parameters": values}}) if values else "")
        ros = ["--ros-args", *(["--params-file", str(file)] if values else [])]
        if namespace:
            ros += ["-r", f"__ns:={namespace}"]
        full = {
            **os.environ,
            "ROS_DOMAIN_ID": str(self.domain),
            "ROS_LOG_DIR": str(self.folder),
            **(environment or {}),
        }
        command = [*(program or _command(executable)), *ros, *arguments]
        forked = executable in FORKED and not fresh
        process = NodeProcess(command, full, self.folder / f"{executable}_{number}.log", forked)
        self.processes.append(process)
        return process

    def driver(self, *arguments: str, **named: Any) -> NodeProcess:
        """Start a driver that does not wait long for another one."""
        return self.start("driver_node", *arguments, **{"discovery_time": 0.1, **named})

    def add(self, kind: type[Node], **parameters: Any) -> Any:
        """A node with `end`, in the process and the thread of the test's own."""
        overrides = [rclpy.Parameter(name.replace("__", "."), value=value) for name, value in parameters.items()]
        node = kind(context=self._context, parameter_overrides=overrides)
        self._spinning.executor.add_node(node)
        self._added.append(node)
        return node

    def second_node(self, name: str) -> LabNode:
        """A node of the test's own in a thread of its own: what it does holds up nobody."""
        node = LabNode(name, context=self._context)
        self._others.append((node, Spinning(self._context, node)))
        return node

    def wait(self, condition: Callable[[], Any], what: str, timeout: float = PATIENCE) -> Any:
        """Wait until a condition holds and return its value; fail with the logs of the processes otherwise."""
        deadline = time.monotonic() + timeout
        while not (value := condition()):
            if time.monotonic() > deadline:
                logs = "\n".join(process.output for process in self.processes)
                pytest.fail(f"waited {timeout:g} s for {what}, which did not come\n{logs}")
            time.sleep(0.005)
        return value

    @staticmethod
    def pause(duration: float) -> None:
        """Let the processes run for a while [s]."""
        time.sleep(duration)

    def do(self, function: Callable[[], Any]) -> Any:
        """Call a function in the thread of the node, where what it takes part in can be taken away."""
        task = self._spinning.executor.create_task(function)
        self.wait(task.done, "a call in the thread of the node")
        return task.result()

    def listen(self, kind: type, topic: str, quality: Any = COMMAND) -> list:
        """A list that fills with the messages of a topic."""
        messages: list = []
        self._heard.append(self.node.create_subscription(kind, topic, messages.append, quality))
        return messages

    def samples(self, topic: str = "samples") -> Samples:
        """Blocks of a topic, from now on."""
        samples = Samples()
        self._heard.append(self.node.create_subscription(PointCloud2, topic, samples.take, DEEP))
        return samples

    def streaming(self, topic: str = "samples") -> Samples:
        """Blocks of a topic, once the first one has come."""
        samples = self.samples(topic)
        self.wait(lambda: samples.blocks, f"the first block of {topic}")
        return samples

    def phases(self, namespace: str = "") -> list[String]:
        return self.listen(String, f"{namespace}/phase" if namespace else "phase", LATCHED)

    def statuses(self) -> list[DiagnosticStatus]:
        """Messages of command_status, from now on and the last ones before."""
        return self.listen(DiagnosticStatus, "command_status", COMMAND_STATUS)

    @staticmethod
    def states(statuses: list[DiagnosticStatus], name: str) -> list[str]:
        """The states that a command went through, in order."""
        return [values_of(status)["state"] for status in list(statuses) if status.name == name]

    @staticmethod
    def value(statuses: list[DiagnosticStatus], name: str, state: str, key: str) -> int:
        """A value of the status that a command had in a state."""
        found = [values_of(status) for status in list(statuses) if status.name == name]
        return int(next(values[key] for values in found if values["state"] == state))

    def diagnostics(self) -> list[DiagnosticArray]:
        return self.listen(DiagnosticArray, "/diagnostics", 10)

    def publisher(self, kind: type, topic: str, quality: Any = COMMAND) -> Any:
        """A publisher that somebody listens to."""
        publisher = self.node.create_publisher(kind, topic, quality)
        self.wait(lambda: publisher.get_subscription_count() > 0, f"a subscriber of {topic}")
        return publisher

    def send(self, voltage: Any, phase: str, sample_period: float = 2e-5, *, age: float | None = 0.0) -> None:
        """Send a command with the stamp of now less `age` [s]; None for no stamp."""
        if not hasattr(self, "_command"):
            self._command = self.publisher(PointCloud2, "command")
        stamp = None
        if age is not None:
            stamp = (self.node.get_clock().now() - rclpy.duration.Duration(seconds=age)).to_msg()
        self._command.publish(command_to_cloud(voltage, sample_period, phase, stamp))

    def renew_command(self) -> None:
        """Send the next command from a new publisher: a new driver may never find one that its predecessor knew."""
        del self._command

    def call(self, kind: type, service: str, request: Any = None) -> Any:
        """Answer of a service. A `Trigger` is sent once; anything else again where no answer comes."""
        client, probe = self._client(kind, service)
        if probe is not None:  # an answer to a client that the node has not found yet is lost
            self._answer(probe, GetParameters.Request(), f"{service} to find its client", 1.0)
        interval = PATIENCE if kind is Trigger else 10.0
        return self._answer(client, request or kind.Request(), f"an answer of {service}", interval)

    def _client(self, kind: type, service: str) -> tuple[Any, Any]:
        """A client, kept for the next call, and for a `Trigger` another one of the same node, made after it.

        A node finds both in the order in which they were made: one that answers the second knows the first.
        """
        if service not in self._clients:
            client, probe = self.node.create_client(kind, service), None
            if kind is Trigger:
                probe = self.node.create_client(GetParameters, f"{service.rpartition('/')[0]}/get_parameters")
            self._clients[service] = client, probe
        return self._clients[service]

    def _answer(self, client: Any, request: Any, what: str, interval: float) -> Any:
        self.wait(client.service_is_ready, f"the service {client.srv_name}")
        futures: list[Any] = []
        asked = time.monotonic()

        def answered() -> Any:
            if time.monotonic() >= asked + interval * len(futures):
                futures.append(client.call_async(request))
            return next((future for future in futures if future.done()), None)

        return self.wait(answered, what).result()

    def transition(self, name: str, node: str = "driver_node") -> bool:
        """Ask a lifecycle node for a transition."""
        request = ChangeState.Request()
        request.transition.label = name
        request.transition.id = _TRANSITIONS[name]
        done = self.call(ChangeState, f"{node}/change_state", request).success
        return done or self.state(node) == _REACHED.get(name)

    def state(self, node: str = "driver_node") -> str:
        """State of a lifecycle node."""
        return self.call(GetState, f"{node}/get_state").current_state.label

    def forget(self) -> None:
        """Hear nothing more of what was subscribed so far."""
        for subscription in self._heard:
            self.do(lambda subscription=subscription: self.node.destroy_subscription(subscription))
        self._heard.clear()

    def close(self) -> None:
        for process in self.processes:
            process.end()
        for node in self._added:
            node.end()
        self._spinning.end()
        for node, spinning in self._others:
            spinning.end()
            node.destroy_node()
        for node in self._added:
            node.destroy_node()
        self.node.destroy_node()
        rclpy.shutdown(context=self._context)


_TRANSITIONS = {"configure": 1, "cleanup": 2, "activate": 3, "deactivate": 4}
_REACHED = {"configure": "inactive", "cleanup": "unconfigured", "activate": "active", "deactivate": "inactive"}


def _command(executable: str) -> list[str]:
    try:
        built = Path(get_package_prefix("piezo_hysteresis")) / "lib" / "piezo_hysteresis" / executable
    except (PackageNotFoundError, OSError):
        built = Path()
    return [str(built)] if built.is_file() else [sys.executable, "-m", f"piezo_hysteresis.nodes.{executable}"]
