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

"""Start: import of the package, node ready after its process began, first prediction after the first block, and after
both nodes were started at once.

Wall-clock time, kernels compiled and cached before. The model node counts as ready when it subscribes to `samples`, the
driver when a first block comes; the first prediction that comes counts from the last sample of its block.

    python -m benchmarks.start --repeats 5
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Self, TypeVar

import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from sensor_msgs.msg import PointCloud2

from benchmarks.figures import Cell, Figures, alone
from benchmarks.simulation import ARX, PERIOD
from benchmarks.streaming import LARGE_BLOCKS
from examples.demo.processes import Processes
from piezo_hysteresis.effects import BoucWen
from piezo_hysteresis.model.model import Model
from piezo_hysteresis.model.model_file import save
from piezo_hysteresis.nodes.messages.cloud import from_cloud
from piezo_hysteresis.nodes.messages.conversions import from_stamp
from piezo_hysteresis.nodes.runtime.qos import SAMPLES

NAMESPACE = "/start"
PATIENCE = 60.0
T = TypeVar("T")
IMPORTS = ("numpy", "piezo_hysteresis", "piezo_hysteresis.nodes.model.model_node")


def import_time(module: str) -> float:
    """Seconds a new interpreter needs to import a module."""
    code = f"import time; begin = time.perf_counter(); import {module}; print(time.perf_counter() - begin)"
    return float(subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True).stdout)


class _Watch:
    """Both nodes, and the first message of either that is heard."""

    def __init__(self, folder: Path) -> None:
        save(Model((BoucWen(), ARX), PERIOD, 10.0, 3e-5), folder / "model.yaml")
        self.folder, self.first = folder, dict[str, tuple[float, PointCloud2]]()
        self.node, self._executor = Node("watch", namespace=NAMESPACE), SingleThreadedExecutor()
        self._executor.add_node(self.node)
        self._processes = Processes(NAMESPACE, folder / "log")

    def __enter__(self) -> Self:
        self._processes.__enter__()
        return self

    def __exit__(self, *reason: object) -> None:
        self._processes.__exit__(None, None, None)
        self.node.destroy_node()

    def start_model_node(self) -> None:
        self._processes.start("model_node", model_file=self.folder / "model.yaml")

    def start_driver(self) -> None:
        self._processes.start("driver_node", sample_period=f"{PERIOD:.12f}", discovery_time=0.1)

    def listen(self) -> None:
        for topic in ("samples", "predicted_samples"):
            self.node.create_subscription(PointCloud2, topic, partial(self._take, topic), SAMPLES)

    def _take(self, topic: str, cloud: PointCloud2) -> None:
        self.first.setdefault(topic, (time.time(), cloud))

    def wait(self, done: Callable[[], bool], what: str) -> None:
        end = time.monotonic() + PATIENCE
        while not done():
            self._executor.spin_once(timeout_sec=0.01)
            self._processes.check()
            if time.monotonic() > end:
                raise TimeoutError(f"{what}: nothing after {PATIENCE:g} s")


def node_times(folder: Path) -> tuple[float, float, float]:
    """Model node ready, driver's first block, first prediction after the last sample of its block [s]."""
    with _Watch(folder) as watch:
        begin = time.time()
        watch.start_model_node()
        watch.wait(lambda: watch.node.count_subscribers("samples") > 0, "the model node")
        ready = time.time() - begin
        watch.listen()
        begin = time.time()
        watch.start_driver()
        watch.wait(lambda: len(watch.first) == 2, "the first prediction")
    arrival, predicted = watch.first["predicted_samples"]
    columns = from_cloud(predicted, {"time": "f8"})
    taken = from_stamp(predicted.header.stamp) * 1e-9 + float(columns["time"][-1])
    return ready, watch.first["samples"][0] - begin, arrival - taken


def meeting_time(folder: Path) -> float:
    """From the start of both nodes at once, as by a launch file, to the first prediction that is heard [s]."""
    with _Watch(folder) as watch:
        watch.listen()
        begin = time.time()
        watch.start_driver()
        watch.start_model_node()
        watch.wait(lambda: len(watch.first) == 2, "the first prediction")
    return watch.first["predicted_samples"][0] - begin


def repeated(work: Callable[[Path], T], times: int) -> list[T]:
    """`work` in a participant and folders of its own."""
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    results = []
    try:
        for _ in range(times):
            with tempfile.TemporaryDirectory() as folder:
                results.append(work(Path(folder)))
    finally:
        rclpy.try_shutdown()
    return results


def arguments(parser: argparse.ArgumentParser) -> None:
    """Options."""
    parser.add_argument("--repeats", type=int, default=3)


def run(options: argparse.Namespace) -> list[Figures]:
    """Best and worst of some starts."""
    rows: list[tuple[Cell, ...]] = []

    def row(what: str, times: list[float]) -> None:
        rows.append((what, min(times), max(times)))

    for module in IMPORTS:
        row(f"import {module}", [import_time(module) for _ in range(options.repeats)])
    os.environ.setdefault("ROS_DOMAIN_ID", str(1 + os.getpid() % 100))
    labels = (
        "model node subscribes after its start",
        "first block after the driver's start",
        "first prediction after the last sample of its block",
    )
    for what, times in zip(labels, zip(*repeated(node_times, options.repeats), strict=True), strict=True):
        row(what, list(times))
    row("both started at once, first prediction heard", repeated(meeting_time, options.repeats))
    os.environ.setdefault("FASTDDS_DEFAULT_PROFILES_FILE", str(LARGE_BLOCKS))
    row("the same with large_blocks.xml", repeated(meeting_time, options.repeats))
    return [Figures("Start, kernels cached", ("what", "shortest, s", "longest, s"), rows)]


if __name__ == "__main__":
    alone(__name__)
