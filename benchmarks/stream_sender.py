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

"""The process that has a waveform played again and again while a stream is recorded.

It is a process of its own, because a recorder that packs and sends megabytes would miss blocks meanwhile.

    scripts/run python -m benchmarks.stream_sender /stage_x 2e-5 waveform.npy
"""

from __future__ import annotations

import itertools
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import numpy as np
import rclpy
from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.executors import ExternalShutdownException
from rclpy.task import Future
from sensor_msgs.msg import PointCloud2

from piezo_hysteresis.nodes.messages.conversions import command_to_cloud, values_of
from piezo_hysteresis.nodes.messages.phase_text import PHASE_FIELD
from piezo_hysteresis.nodes.runtime.executor import make_executor, spin_until
from piezo_hysteresis.nodes.runtime.guarded_node import GuardedNode
from piezo_hysteresis.nodes.runtime.qos import COMMAND, COMMAND_STATUS
from piezo_hysteresis.nodes.runtime.sending import is_taken_by, send

DRIVER = "driver_node"
ENDED = ("done", "stopped", "refused")
_LOOK = 0.05
"""Time between two looks for the driver [s]."""


@contextmanager
def sender(namespace: str, sample_period: float, waveform: Path) -> Iterator[Callable[[], None]]:
    """Have the waveform of a file played until the function that is given is called, which does not wait."""
    command = [sys.executable, "-m", __name__, namespace, repr(sample_period), str(waveform)]
    process = subprocess.Popen(command)
    try:
        yield process.terminate
    finally:
        process.terminate()
        process.wait()


def main(namespace: str, sample_period: float, waveform: Path) -> None:
    """Send it whenever the one before has ended; until a signal comes, or one is not played to its end.

    Without a stamp, for where no core is free it may be old when it comes.
    """
    cloud = command_to_cloud(np.load(waveform), sample_period, "stream")
    rclpy.init()
    node, executor = GuardedNode("sender", namespace=namespace), make_executor()
    publisher = node.create_publisher(PointCloud2, "command", COMMAND)
    states: dict[str, Future[str]] = {}

    def take(status: DiagnosticStatus) -> None:
        state = values_of(status)["state"]
        if state in ENDED and status.name in states:
            states.pop(status.name).set_result(state)

    node.create_subscription(DiagnosticStatus, "command_status", take, COMMAND_STATUS)
    executor.add_node(node)

    def is_known() -> bool:
        """Whether the driver takes commands; a recorder that was found before it does too."""
        everybody = publisher.get_subscription_count() == node.count_subscribers("command")
        return everybody and is_taken_by(DRIVER, node, publisher)

    with suppress(ExternalShutdownException):
        while not is_known():
            executor.spin_until_future_complete(Future(), timeout_sec=_LOOK)
        for name in map("stream_{}".format, itertools.count()):
            cloud.fields[-1].name = PHASE_FIELD + name
            ended = states[name] = Future()
            send(publisher, cloud)
            spin_until(executor, ended, node)
            if ended.result() != "done":
                break


if __name__ == "__main__":
    main(sys.argv[1], float(sys.argv[2]), Path(sys.argv[3]))
