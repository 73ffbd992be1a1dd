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

"""The limit of streaming: three processes that hand blocks on by rclpy alone, without computing or writing anything.

A source publishes blocks of the size and at the pace of the driver, a relay publishes each one again, and this process
receives both. The difference to the benchmark of streaming is the cost of the nodes.

    scripts/run python -m benchmarks.relay source 500   (one of the processes, with blocks of 500 samples)
"""

from __future__ import annotations

import os
import struct
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from contextlib import ExitStack, suppress
from pathlib import Path

import numpy as np
import rclpy
from rclpy.executors import Executor, ExternalShutdownException
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.task import Future
from sensor_msgs.msg import PointCloud2

from piezo_hysteresis.nodes.messages.cloud_stream import CloudWriter
from piezo_hysteresis.nodes.messages.conversions import to_stamp
from piezo_hysteresis.nodes.messages.samples import SAMPLES as LAYOUT
from piezo_hysteresis.nodes.runtime.executor import make_executor
from piezo_hysteresis.nodes.runtime.qos import DEEP, SAMPLES
from piezo_hysteresis.nodes.runtime.sending import send

BLOCK = 0.01
"""Time that a block covers, as that of the driver [s]."""
START = 4.0
"""Time for the processes to find one another [s]."""
_STAMP = struct.Struct("=4xiI")


def processor_time(pid: int) -> float:
    """User and system time of a process so far [s]."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def relayed(rate: float, duration: float) -> tuple[float, float]:
    """Processor time of the three processes [% of a core], and the 99th percentile of the latency [ms]."""
    node, executor, latencies = Node("relay_end"), make_executor(), list[float]()
    with ExitStack() as stack:
        stack.callback(executor.shutdown)
        stack.callback(node.destroy_node)

        def take(message: bytes) -> None:
            seconds, nanoseconds = _STAMP.unpack_from(message)
            latencies.append(1e3 * (time.time() - seconds - 1e-9 * nanoseconds))

        node.create_subscription(PointCloud2, "relay_source", lambda message: None, DEEP, raw=True)
        node.create_subscription(PointCloud2, "relay", take, DEEP, raw=True)
        executor.add_node(node)
        ids = []
        for role in ("relay", "source"):
            command = [sys.executable, "-m", "benchmarks.relay", role, str(round(rate * BLOCK))]
            process = subprocess.Popen(command)
            stack.callback(process.wait)
            stack.callback(process.terminate)
            ids.append(process.pid)
        _spin(executor, START)
        latencies.clear()
        begin, spent = time.monotonic(), time.process_time() + sum(map(processor_time, ids))
        _spin(executor, duration)
        spent = time.process_time() + sum(map(processor_time, ids)) - spent
        share = 100.0 * spent / (time.monotonic() - begin)
    return share, float(np.percentile(latencies, 99))


def _spin(executor: Executor, duration: float) -> None:
    executor.spin_until_future_complete(Future(), timeout_sec=duration)


def _play(publisher: Publisher, size: int) -> None:
    writer, columns = CloudWriter(LAYOUT), {name: np.zeros(size, word) for name, word in LAYOUT.items()}
    due = time.monotonic()
    given = True
    while given:
        due += BLOCK
        time.sleep(max(0.0, due - time.monotonic()))
        given = send(publisher, writer.write(columns, to_stamp(time.time_ns())))


def main(role: str, size: int) -> None:
    """Be one of the processes, until it is ended."""
    rclpy.init()
    node, executor = Node(role), make_executor()
    publisher = node.create_publisher(PointCloud2, "relay_source" if role == "source" else "relay", SAMPLES)
    if role == "source":
        threading.Thread(target=_play, args=(publisher, size), daemon=True).start()
    else:
        hand_on: Callable[[bytes], None] = publisher.publish
        node.create_subscription(PointCloud2, "relay_source", hand_on, DEEP, raw=True)
    executor.add_node(node)
    with suppress(ExternalShutdownException):
        while rclpy.ok():
            _spin(executor, 1.0)  # without a limit the events executor does not see the end of the context


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]))
