"""Streaming over DDS: driver, model node and a recorder as processes of their own; nothing may be lost.

The driver plays sines and slow loops without a pause; this process is the recorder and writes every topic to a bag, in
which the samples are counted afterwards. Latency counts from the last sample of a block to its residual in the
recorder's hands. The exit code is 1 where a sample is missing, doubled, or was played at another voltage than was
commanded.

    python -m benchmarks.streaming --rate 50e3 200e3 --seconds 30
"""

from __future__ import annotations

import argparse
import os
import resource
import tempfile
import time
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import rclpy
from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.serialization import deserialize_message
from rclpy.signals import SignalHandlerOptions
from sensor_msgs.msg import PointCloud2

from benchmarks.figures import Cell, Figures, alone
from benchmarks.simulation import ARX
from examples.demo.processes import Processes
from piezo_hysteresis.effects import BoucWen
from piezo_hysteresis.identification.drive import DriveLimits
from piezo_hysteresis.identification.excitation import sine, triangle
from piezo_hysteresis.model import Model
from piezo_hysteresis.model_file import save
from piezo_hysteresis.nodes.bag_recorder import BagRecorder
from piezo_hysteresis.nodes.cloud import from_cloud
from piezo_hysteresis.nodes.conversions import command_to_cloud, from_stamp, values_of
from piezo_hysteresis.nodes.quality import COMMAND, COMMAND_STATUS
from piezo_hysteresis.recording.bag import Bag

NAMESPACE = "/bench"
NODES = ("driver_node", "model_node")
LONGEST = 500_000
"""Samples of a command at most."""
PATIENCE = 60.0
CATCH_UP = 5.0
"""What the model node may be behind at the end [s]; what comes later counts as lost."""
STEP = 20.0 / 2**16
"""Of the 16-bit converter of the simulated stage [V]: the recording holds what was applied."""


@dataclass
class Command:
    """A waveform that was played, and the index of its first sample."""

    voltage: np.ndarray
    first: int


class Recorder:
    """The third process: sends waveforms, and records everything.

    Parameters
    ----------
    folder : pathlib.Path
        For the bag.
    check : callable
        Raises where a node has ended.
    """

    def __init__(self, folder: Path, check: Callable[[], None]) -> None:
        self._check = check
        self._node = Node("recorder", namespace=NAMESPACE)
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self._node)
        self._ended: dict[str, dict[str, str]] = {}
        self._command = self._node.create_publisher(PointCloud2, "command", COMMAND)
        self._node.create_subscription(DiagnosticStatus, "command_status", self._on_status, COMMAND_STATUS)
        self.bag = BagRecorder(self._node, folder)

    def _on_status(self, status: DiagnosticStatus) -> None:
        told = values_of(status)
        if told["state"] in ("refused", "stopped", "done"):
            self._ended[status.name] = {**told, "reason": status.message}

    def wait(self, done: Callable[[], bool], what: str, timeout: float = PATIENCE) -> None:
        """Spin until `done`."""
        end = time.monotonic() + timeout
        while not done():
            self._executor.spin_once(timeout_sec=0.02)
            if time.monotonic() > end:
                raise TimeoutError(f"{what}: nothing after {timeout:g} s")
            self._check()

    def pause(self, duration: float) -> None:
        """Spin for a while [s]."""
        end = time.monotonic() + duration
        self.wait(lambda: time.monotonic() > end, "the end of a pause", duration + PATIENCE)

    def play(self, voltage: np.ndarray, sample_period: float, name: str) -> Command:
        """Have a waveform played to its end."""
        stamp = self._node.get_clock().now().to_msg()
        self._command.publish(command_to_cloud(voltage, sample_period, name, stamp))
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


def waveform(rate: float, duration: float) -> np.ndarray:
    """Triangles of 1 Hz and a sine of 100 Hz in turns, from safe to safe [V]."""
    limits = DriveLimits(sample_period=1.0 / rate)
    half = max(0.1, duration / 2 - 0.5)
    loops = triangle(limits, (1.0,) * max(1, round(half)), 1.0)
    parts = (loops, sine(limits, 100.0, half))
    return np.concatenate([limits.from_safe_to_safe(part) for part in parts])


def processor_time(pid: int) -> float:
    """User and system time of a process so far [s]."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def memory(pid: int) -> float:
    """Largest resident size of a process so far [MB]."""
    lines = Path(f"/proc/{pid}/status").read_text().splitlines()
    return next(float(line.split()[1]) for line in lines if line.startswith("VmHWM")) / 1024


def stream(rate: float, duration: float, folder: Path) -> tuple[dict[str, Cell], list[str]]:
    """Figures by name, and the promises that were not kept."""
    period = 1.0 / rate
    voltage = waveform(rate, min(duration, LONGEST / rate))
    save(Model((BoucWen(), ARX), period, 10.0, 3e-5), folder / "model.yaml")
    with ExitStack() as stack:
        processes = stack.enter_context(Processes(NAMESPACE, folder / "log"))
        processes.start("driver_node", sample_period=f"{period:.12f}", discovery_time=0.1)
        processes.start("model_node", model_file=folder / "model.yaml")
        recorder = Recorder(folder / "bag", processes.check)
        stack.callback(recorder.close)
        recorder.wait(lambda: recorder.bag.counts["predicted_samples"] > 0, "the first prediction")
        recorder.pause(2.0)
        ids = [processes.ids[name] for name in NODES]
        begin, spent, own = time.monotonic(), [processor_time(i) for i in ids], time.process_time()
        commands: list[Command] = []
        while time.monotonic() < begin + duration:
            commands.append(recorder.play(voltage, period, f"stream_{len(commands)}"))
        elapsed = time.monotonic() - begin
        shares = [100 * (processor_time(i) - s) / elapsed for i, s in zip(ids, spent, strict=True)]
        shares.append(100 * (time.process_time() - own) / elapsed)
        recorder.follow(commands[-1])
        sizes = [memory(i) for i in ids] + [resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024]
    figures, failures = count(folder / "bag", commands)
    names = ("driver", "model node", "recorder")
    figures = {
        "rate, kHz": rate / 1e3,
        "time, s": elapsed,
        **figures,
        **{f"CPU of {name}, % of a core": share for name, share in zip(names, shares, strict=True)},
        "CPU of all three, % of a core": sum(shares),
        **{f"memory of {name}, MB": size for name, size in zip(names, sizes, strict=True)},
    }
    return figures, [f"{rate / 1e3:g} kHz: {failure}" for failure in failures]


def count(bag: Path, commands: list[Command]) -> tuple[dict[str, Cell], list[str]]:
    """Samples sent, received and predicted, latencies, and what is wrong with them."""
    first, last = commands[0].first, commands[-1].first + commands[-1].voltage.size - 1
    sent = (last - first) % 2**32 + 1
    topics = {f"{NAMESPACE}/{name}": name for name in ("samples", "predicted_samples")}
    places: dict[str, list[np.ndarray]] = {name: [] for name in topics.values()}
    voltages, latencies = [], []
    for message in Bag(bag).messages(topics):
        cloud = deserialize_message(message.raw, PointCloud2)
        columns = from_cloud(cloud, {"time": "f8", "index": "u4"}, {"voltage": "f8"})
        place = (columns["index"].astype(np.int64) - first) % 2**32
        inside = place < sent
        places[topics[message.topic]].append(place[inside])
        if "voltage" in columns:
            voltages.append(columns["voltage"][inside])
        elif inside.all():
            latencies.append((message.time_ns - from_stamp(cloud.header.stamp)) * 1e-6 - 1e3 * columns["time"][-1])
    failures, received = [], []
    for name, found in places.items():
        numbers = np.concatenate(found)
        unique = np.unique(numbers).size
        received.append(unique)
        if unique < sent or numbers.size > unique:
            failures.append(f"{name}: {sent - unique} lost, {numbers.size - unique} doubled")
    at, played = np.concatenate(places["samples"]), np.concatenate(voltages)
    for k, command in enumerate(commands):
        own = (at - (command.first - first)) % 2**32
        inside = own < command.voltage.size
        other = int((np.abs(played[inside] - command.voltage[own[inside]]) > 1.001 * STEP).sum())
        if other:
            failures.append(f"command {k}: {other} samples further from the command than a converter step")
    middle, late, latest = np.percentile(latencies, (50, 99, 100)).tolist()
    return {
        "samples sent by the driver": sent,
        "samples recorded": received[0],
        "samples lost": sent - received[0],
        "residuals recorded": received[1],
        "residuals lost": sent - received[1],
        "latency, block end to residual, p50, ms": middle,
        "latency p99, ms": late,
        "latency max, ms": latest,
    }, failures


def arguments(parser: argparse.ArgumentParser) -> None:
    """Options."""
    parser.add_argument("--rate", type=float, nargs="+", default=[50e3], help="samples per second")
    parser.add_argument("--seconds", type=float, default=30.0, help="of every rate")


def run(options: argparse.Namespace) -> list[Figures]:
    """One table, a column for every rate."""
    os.environ.setdefault("ROS_DOMAIN_ID", str(1 + os.getpid() % 100))
    columns: list[dict[str, Cell]] = []
    failures: list[str] = []
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    try:
        for rate in options.rate:
            with tempfile.TemporaryDirectory() as folder:
                column, failed = stream(rate, options.seconds, Path(folder))
            columns.append(column)
            failures += failed
    finally:
        rclpy.try_shutdown()
    head, *rows = [(name, *(column[name] for column in columns)) for name in columns[0]]
    heads = (str(head[0]), *(f"{rate:g}" for rate in head[1:]))
    return [Figures("Streaming: driver → model node → recorder, three processes", heads, rows, tuple(failures))]


if __name__ == "__main__":
    alone(__name__)
