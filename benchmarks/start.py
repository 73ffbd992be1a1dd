"""Start: import of the package, node ready after its process began, first prediction after the first block.

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
from pathlib import Path

import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from sensor_msgs.msg import PointCloud2

from benchmarks.figures import Cell, Figures, alone
from benchmarks.simulation import ARX, PERIOD
from examples.demo.processes import Processes
from piezo_hysteresis.effects import BoucWen
from piezo_hysteresis.model import Model
from piezo_hysteresis.model_file import save
from piezo_hysteresis.nodes.cloud import from_cloud
from piezo_hysteresis.nodes.conversions import from_stamp
from piezo_hysteresis.nodes.quality import SAMPLES

NAMESPACE = "/start"
PATIENCE = 60.0
IMPORTS = ("numpy", "piezo_hysteresis", "piezo_hysteresis.nodes.model_node")


def import_time(module: str) -> float:
    """Seconds a new interpreter needs to import a module."""
    code = f"import time; begin = time.perf_counter(); import {module}; print(time.perf_counter() - begin)"
    return float(subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True).stdout)


def node_times(folder: Path) -> tuple[float, float, float]:
    """Model node ready, driver's first block, first prediction after the last sample of its block [s]."""
    save(Model((BoucWen(), ARX), PERIOD, 10.0, 3e-5), folder / "model.yaml")
    first: dict[str, tuple[float, PointCloud2]] = {}
    node = Node("watch", namespace=NAMESPACE)
    executor = SingleThreadedExecutor()
    executor.add_node(node)

    def watch(topic: str) -> None:
        node.create_subscription(
            PointCloud2, topic, lambda cloud: first.setdefault(topic, (time.time(), cloud)), SAMPLES
        )

    with Processes(NAMESPACE, folder / "log") as processes:

        def wait(done: Callable[[], bool], what: str) -> float:
            end = time.monotonic() + PATIENCE
            while not done():
                executor.spin_once(timeout_sec=0.01)
                processes.check()
                if time.monotonic() > end:
                    raise TimeoutError(f"{what}: nothing after {PATIENCE:g} s")
            return time.monotonic()

        begin = time.monotonic()
        processes.start("model_node", model_file=folder / "model.yaml")
        ready = wait(lambda: node.count_subscribers("samples") > 0, "the model node") - begin
        watch("samples")
        watch("predicted_samples")
        begin = time.time()
        processes.start("driver_node", sample_period=f"{PERIOD:.12f}", discovery_time=0.1)
        wait(lambda: len(first) == 2, "the first prediction")
    node.destroy_node()
    arrival, predicted = first["predicted_samples"]
    columns = from_cloud(predicted, {"time": "f8"})
    taken = from_stamp(predicted.header.stamp) * 1e-9 + float(columns["time"][-1])
    return ready, first["samples"][0] - begin, arrival - taken


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
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    try:
        starts = []
        for _ in range(options.repeats):
            with tempfile.TemporaryDirectory() as folder:
                starts.append(node_times(Path(folder)))
    finally:
        rclpy.try_shutdown()
    told = (
        "model node subscribes after its start",
        "first block after the driver's start",
        "first prediction after the last sample of its block",
    )
    for what, times in zip(told, zip(*starts, strict=True), strict=True):
        row(what, list(times))
    return [Figures("Start, kernels cached", ("what", "shortest, s", "longest, s"), rows)]


if __name__ == "__main__":
    alone(__name__)
