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

"""Streaming over DDS: driver, model node and a recorder as separate processes; no sample may be lost.

A fourth process sends sines and slow loops, which the driver plays one after the other; this process is the recorder.
It writes every topic to a bag, at the first rate once more the samples and predictions alone, and counts the samples in
the bag afterwards. Latency is the time from the last sample of a block to its residual in the recorder. For comparison,
three processes hand on the same data by rclpy alone.

The exit code is 1 if, up to 500 kHz, a sample is missing, doubled, or was played at another voltage than commanded.
Beyond that, the highest rate without a loss is searched. All processes use `config/large_blocks.xml`.

    python -m benchmarks.streaming --rate 50e3 200e3 --seconds 30
"""

from __future__ import annotations

import argparse
import gc
import os
import tempfile
import time
from collections.abc import Collection
from contextlib import ExitStack
from pathlib import Path

import numpy as np
import rclpy
from rclpy.serialization import deserialize_message
from rclpy.signals import SignalHandlerOptions
from sensor_msgs.msg import PointCloud2

from benchmarks.figures import Cell, Figures, alone
from benchmarks.relay import processor_time, relayed
from benchmarks.simulation import ARX
from benchmarks.stream_recorder import StreamRecorder
from benchmarks.stream_sender import sender
from examples.demo.processes import Processes
from piezo_hysteresis.effects import BoucWen
from piezo_hysteresis.identification.protocol.drive_limits import DriveLimits
from piezo_hysteresis.identification.protocol.excitation import sine, triangle
from piezo_hysteresis.model.model import Model
from piezo_hysteresis.model.model_file import save
from piezo_hysteresis.nodes.messages.cloud import from_cloud
from piezo_hysteresis.nodes.messages.conversions import from_stamp
from piezo_hysteresis.nodes.runtime.executor import make_executor
from piezo_hysteresis.nodes.topics import TOPICS
from piezo_hysteresis.recording.bag.bag import Bag

NODES = ("driver_node", "model_node")
BLOCKS = ("samples", "predicted_samples")
LARGE_BLOCKS = Path(__file__).parents[1] / "config" / "large_blocks.xml"
"""Room for large blocks."""
LONGEST = 500_000
"""Samples of a command at most."""
PROMISED = 500e3
"""Rate up to which a lost sample is a failure [Hz]."""
FASTER = 2.0**0.5
"""Step of the search for the highest rate."""
LIMIT = ("rclpy alone, CPU of all, % of a core", "rclpy alone, latency p99, ms")
"""See `benchmarks.relay`."""
STEP = 20.0 / 2**16
"""Of the 16-bit converter of the simulated stage [V]: the recording holds what was applied."""


def waveform(rate: float, duration: float) -> np.ndarray:
    """Triangles of 1 Hz and a sine of 100 Hz in turns, from safe to safe [V]."""
    limits = DriveLimits(sample_period=1.0 / rate)
    half = max(0.1, duration / 2 - 0.5)
    loops = triangle(limits, (1.0,) * max(1, round(half)), 1.0)
    parts = (loops, sine(limits, 100.0, half))
    return np.concatenate([limits.from_safe_to_safe(part) for part in parts])


def memory(pid: int) -> float:
    """Resident size of a process [MB]."""
    lines = Path(f"/proc/{pid}/status").read_text().splitlines()
    return next(float(line.split()[1]) for line in lines if line.startswith("VmRSS")) / 1024


def stream(
    rate: float, duration: float, folder: Path, axes: int, topics: Collection[str]
) -> tuple[dict[str, Cell], list[str]]:
    """Figures by name, and the promises that were not kept."""
    period = 1.0 / rate
    voltage = waveform(rate, min(duration, LONGEST / rate))
    save(Model((BoucWen(), ARX), period, 10.0, 3e-5), folder / "model.yaml")
    np.save(folder / "waveform.npy", voltage)
    with ExitStack() as stack:
        executor, recorders, ids = make_executor(), list[StreamRecorder](), dict[str, list[int]]()
        stack.callback(executor.shutdown)
        for axis in range(axes):
            processes = stack.enter_context(Processes(f"/bench_{axis}", folder / f"log_{axis}"))
            processes.start("driver_node", sample_period=f"{period:.17f}", discovery_time=0.1)
            processes.start("model_node", model_file=folder / "model.yaml")
            recorder = StreamRecorder(f"/bench_{axis}", folder / f"bag_{axis}", executor, processes.check, topics)
            stack.callback(recorder.close)
            recorders.append(recorder)
            for name in NODES:
                ids.setdefault(name, []).append(processes.ids[name])
        for recorder in recorders:
            for name in BLOCKS:
                recorder.wait(lambda bag=recorder.bag, name=name: bag.counts[name] > 0, f"the first {name}")
        ends = []
        for axis, recorder in enumerate(recorders):
            ends.append(stack.enter_context(sender(f"/bench_{axis}", period, folder / "waveform.npy")))
            recorder.wait(lambda one=recorder: one.begun > 0, "the first waveform")
        begin, own, span = time.monotonic(), time.process_time(), [time.time_ns()]
        spent = {name: sum(map(processor_time, ids[name])) for name in NODES}
        recorders[0].pause(duration)
        elapsed = time.monotonic() - begin
        span.append(time.time_ns())
        shares = [100 * (sum(map(processor_time, ids[name])) - spent[name]) / elapsed for name in NODES]
        shares.append(100 * (time.process_time() - own) / elapsed)
        for end in ends:
            end()
        for recorder in recorders:
            recorder.follow(voltage.size)
        sizes = [*(max(map(memory, ids[name])) for name in NODES), memory(os.getpid())]
    counted = [count(folder / f"bag_{k}", voltage, one.played, f"/bench_{k}", span) for k, one in enumerate(recorders)]
    figures = {name: _over_axes(name, [one[name] for one, _ in counted]) for name in counted[0][0]}
    names = ("driver", "model node", "recorder")
    figures = {
        "rate, kHz": rate / 1e3,
        "axes": axes,
        "topics recorded": "all" if topics is TOPICS else "blocks",
        "time, s": elapsed,
        **figures,
        **{f"CPU of {name}, % of a core": share for name, share in zip(names, shares, strict=True)},
        "CPU of all, % of a core": sum(shares),
        **{f"memory of {name}, MB": size for name, size in zip(names, sizes, strict=True)},
    }
    return figures, [f"{rate / 1e3:g} kHz: {failure}" for _, failures in counted for failure in failures]


def _over_axes(name: str, values: list[Cell]) -> Cell:
    """Latencies of the worst axis, and samples of all."""
    numbers = [value for value in values if isinstance(value, int | float)]
    return max(numbers) if name.startswith("latency") else sum(numbers)


def count(
    bag: Path, voltage: np.ndarray, firsts: list[int], namespace: str, span: list[int]
) -> tuple[dict[str, Cell], list[str]]:
    """Samples sent, received and predicted, latencies, and what is wrong with them.

    `firsts` are the first samples of the waveforms; latencies are those of the time `span` [ns].
    """
    first, last = firsts[0], firsts[-1] + voltage.size - 1
    sent = (last - first) % 2**32 + 1
    topics = {f"{namespace}/{name}": name for name in BLOCKS}
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
        elif span[0] <= message.time_ns <= span[1]:
            latencies.append((message.time_ns - from_stamp(cloud.header.stamp)) * 1e-6 - 1e3 * columns["time"][-1])
    failures, received = [], []
    for name, found in places.items():
        numbers = np.concatenate(found)
        unique = np.unique(numbers).size
        received.append(unique)
        if unique < sent or numbers.size > unique:
            failures.append(f"{name}: {sent - unique} lost, {numbers.size - unique} doubled")
    at, played = np.concatenate(places["samples"]), np.concatenate(voltages)
    for k, begin in enumerate(firsts):
        own = (at - (begin - first)) % 2**32
        inside = own < voltage.size
        other = int((np.abs(played[inside] - voltage[own[inside]]) > 1.001 * STEP).sum())
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


def tried(
    rate: float, duration: float, axes: int = 1, topics: Collection[str] = TOPICS
) -> tuple[dict[str, Cell] | None, list[str]]:
    """`stream` in a folder of its own; no figures where it could not be played to its end."""
    with tempfile.TemporaryDirectory() as folder:
        try:
            return stream(rate, duration, Path(folder), axes, topics)
        except (RuntimeError, TimeoutError) as error:
            return None, [f"{rate / 1e3:g} kHz: {error}"]


def highest(held: float, duration: float) -> tuple[float, float]:
    """Highest rate that holds, from one that does, and the next one, that does not [Hz]."""
    while True:
        _, failed = tried(held * FASTER, duration)
        if failed:
            return held, held * FASTER
        held *= FASTER


def arguments(parser: argparse.ArgumentParser) -> None:
    """Options."""
    parser.add_argument("--rate", type=float, nargs="+", default=[50e3, 200e3, 500e3, 1e6], help="samples per second")
    parser.add_argument(
        "--seconds",
        type=float,
        default=30.0,
        help="of the first rate, with all topics and with blocks alone; 8 of the others",
    )
    parser.add_argument("--axes", type=int, default=2, help="at once, at the first rate; 1 leaves it out")
    parser.add_argument("--no-search", action="store_true", help="do not search for the highest rate")


def run(options: argparse.Namespace) -> list[Figures]:
    """A column for every rate, one for blocks alone and one for several axes at the first, and the highest rate."""
    os.environ.setdefault("ROS_DOMAIN_ID", str(1 + os.getpid() % 100))
    os.environ.setdefault("FASTDDS_DEFAULT_PROFILES_FILE", str(LARGE_BLOCKS))
    short = min(8.0, options.seconds)
    first, *others = options.rate
    cases: list[tuple[float, float, int, Collection[str]]] = [
        (first, options.seconds, 1, topics) for topics in (TOPICS, BLOCKS)
    ]
    cases += [(rate, short, 1, TOPICS) for rate in others]
    if options.axes > 1:
        cases.append((first, short, options.axes, TOPICS))
    columns: list[dict[str, Cell]] = []
    failures: list[str] = []
    held, tables = 0.0, []
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    gc.collect()
    gc.freeze()  # as the nodes do
    try:
        for rate, duration, axes, topics in cases:
            column, failed = tried(rate, duration, axes, topics)
            if column is not None:
                limit = dict(zip(LIMIT, relayed(rate, short) if axes == 1 else ("", ""), strict=True))
                columns.append({**column, **limit})
            failures += failed if rate <= PROMISED else []
            held = held if failed else max(held, rate)
        if held and not options.no_search:
            found = tuple(rate / 1e3 for rate in highest(held, short))
            tables.append(Figures("Highest rate", ("holds, kHz", "does not hold, kHz"), [found]))
    finally:
        rclpy.try_shutdown()
    names = list(columns[0]) if columns else ["rate, kHz"]
    (_, *rates), *rows = [(name, *(column[name] for column in columns)) for name in names]
    heads = (names[0], *(f"{rate:g}" for rate in rates))
    title = "Streaming: driver → model node → recorder, three processes"
    return [Figures(title, heads, rows, tuple(failures)), *tables]


if __name__ == "__main__":
    alone(__name__)
