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

"""Driver, model and identification node in three processes and in one: processor time, memory, latency, start.

The stage is driven all the time. Latency counts from the last sample of a block to its prediction in the hands of this
process. Start counts from the start of the first process to the first prediction. Both ways are measured in turns.

    scripts/run python -m benchmarks.one_process --seconds 30
"""

from __future__ import annotations

import argparse
import os
import tempfile
import time
from contextlib import ExitStack
from pathlib import Path

import numpy as np
import rclpy
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from sensor_msgs.msg import PointCloud2

from benchmarks.figures import Cell, Figures, alone
from benchmarks.relay import processor_time
from benchmarks.stream_sender import sender
from benchmarks.streaming import memory, waveform
from examples.demo.processes import Processes
from piezo_hysteresis.nodes.messages.cloud_stream import CloudReader
from piezo_hysteresis.nodes.messages.conversions import from_stamp
from piezo_hysteresis.nodes.messages.samples import PREDICTED_SAMPLES
from piezo_hysteresis.nodes.runtime.executor import make_executor
from piezo_hysteresis.nodes.runtime.qos import DEEP

ROOT = Path(__file__).parents[1]
WAYS = {"three": ("driver_node", "model_node", "identification_node"), "one": ("axis_node",)}
"""Executables by number of processes."""
LONGEST_START = 120.0
"""Longest wait for the first prediction [s]."""
SETTLE = 5.0
"""Time between the first prediction and the begin of the measurement [s]."""


class Listener:
    """Receives the predictions of one namespace and measures their delay."""

    def __init__(self, namespace: str) -> None:
        self.node, self.executor = Node("listener", namespace=namespace), make_executor()
        self.latencies: list[float] = []
        self._reader, self._next, self.lost = CloudReader(PREDICTED_SAMPLES), -1, 0
        self.node.create_subscription(PointCloud2, "predicted_samples", self._take, DEEP, raw=True)
        self.executor.add_node(self.node)

    def _take(self, message: bytes) -> None:
        now = time.time_ns()
        columns = self._reader.read(message)
        time_of, index = columns.values["time"], columns.values["index"]
        self.latencies.append((now - from_stamp(columns.stamp)) * 1e-6 - 1e3 * float(time_of[-1]))
        self.lost += 0 if self._next < 0 else (int(index[0]) - self._next) % 2**32
        self._next = (int(index[-1]) + 1) % 2**32

    def wait(self, seconds: float, *, first: bool = False) -> None:
        """Listen for a while, or until the first prediction."""
        end = time.monotonic() + seconds
        while (left := end - time.monotonic()) > 0.0 and not (first and self.latencies):
            self.executor.spin_once(timeout_sec=left)

    def close(self) -> None:
        """End the node."""
        self.executor.shutdown()
        self.node.destroy_node()


def measured(way: str, rate: float, seconds: float, number: int) -> tuple[Cell, ...]:
    """One row of the table."""
    period, namespace = 1.0 / rate, f"/bench_{number}"
    with tempfile.TemporaryDirectory() as name, ExitStack() as stack:
        folder = Path(name)
        np.save(folder / "waveform.npy", waveform(rate, 10.0))
        listener = Listener(namespace)
        stack.callback(listener.close)
        processes = stack.enter_context(Processes(namespace, folder / "log"))
        begin = time.monotonic()
        values = {"sample_period": f"{period:.17f}", "discovery_time": 0.1}
        model = {"model_file": ROOT / "config" / "published_stage.yaml"}
        for executable in WAYS[way]:
            given = {"driver_node": values, "model_node": model, "axis_node": {**values, **model}}
            processes.start(executable, **given.get(executable, {}))
        listener.wait(LONGEST_START, first=True)
        started = time.monotonic() - begin
        stack.enter_context(sender(namespace, period, folder / "waveform.npy"))
        listener.wait(SETTLE)
        ids = [processes.ids[executable] for executable in WAYS[way]]
        listener.latencies.clear()
        listener.lost = 0
        spent, begin = sum(map(processor_time, ids)), time.monotonic()
        listener.wait(seconds)
        processes.check()
        share = 100 * (sum(map(processor_time, ids)) - spent) / (time.monotonic() - begin)
        middle, late = np.percentile(listener.latencies, (50, 99)).tolist()
        return way, rate / 1e3, share, sum(map(memory, ids)), middle, late, listener.lost, started


def arguments(parser: argparse.ArgumentParser) -> None:
    """Options."""
    parser.add_argument("--seconds", type=float, default=30.0, help="of each measurement")
    parser.add_argument("--rate", type=float, nargs="+", default=[10e3, 50e3], help="samples per second")
    parser.add_argument("--turns", type=int, default=2, help="measurements of each way at each rate")


def run(options: argparse.Namespace) -> list[Figures]:
    """One row for each measurement."""
    os.environ.setdefault("ROS_DOMAIN_ID", str(1 + os.getpid() % 100))
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    try:
        plan = [(way, rate) for rate in options.rate for _ in range(options.turns) for way in WAYS]
        rows = [measured(way, rate, options.seconds, k) for k, (way, rate) in enumerate(plan)]
    finally:
        rclpy.shutdown()
    heads = (
        "processes",
        "rate, kHz",
        "processor time, % of a core",
        "memory, MB",
        "latency p50, ms",
        "latency p99, ms",
        "samples lost",
        "start, s",
    )
    return [Figures("One axis in three processes and in one", heads, list(rows))]


if __name__ == "__main__":
    alone(__name__)
