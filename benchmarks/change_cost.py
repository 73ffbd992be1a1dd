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

"""Cost of the change watch in a model node at 50 kHz: processor time with and without a baseline."""

from __future__ import annotations

import os
import tempfile
import time
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path

import numpy as np
import rclpy
from diagnostic_msgs.msg import DiagnosticStatus
from std_srvs.srv import Trigger

from benchmarks.figures import Figures
from benchmarks.relay import processor_time
from benchmarks.stream_sender import sender
from benchmarks.streaming import memory, waveform
from examples.demo.processes import Processes
from piezo_hysteresis.nodes.runtime.qos import COMMAND

ROOT = Path(__file__).parents[1]
PERIOD = 2e-5
"""Sample period of the stage [s]."""
MOST = 10.0
"""Largest cost of the watch in addition to the model [% of a core]."""
BASELINE = 30.0
"""Time over which the baseline is taken [s]."""
PATIENCE = 120.0
"""Longest wait for the model node [s]."""


def cost(seconds: float) -> Figures:
    """Processor time and memory of a model node over some time without a baseline, and with one."""
    os.environ.setdefault("ROS_DOMAIN_ID", str(1 + os.getpid() % 100))
    with tempfile.TemporaryDirectory() as name, ExitStack() as stack:
        folder = Path(name)
        np.save(folder / "waveform.npy", waveform(1.0 / PERIOD, 10.0))
        processes = stack.enter_context(Processes("/bench", folder / "log"))
        processes.start("driver_node", discovery_time=0.1)
        stage = ROOT / "config" / "published_stage.yaml"
        processes.start("model_node", model_file=stage, baseline_folder=folder, baseline_time=BASELINE)
        stack.enter_context(sender("/bench", PERIOD, folder / "waveform.npy"))
        rclpy.init()
        stack.callback(rclpy.try_shutdown)
        node = rclpy.create_node("cost", namespace="/bench")
        stack.callback(node.destroy_node)
        heard: list[DiagnosticStatus] = []
        node.create_subscription(DiagnosticStatus, "change", heard.append, COMMAND)
        ask = node.create_client(Trigger, "model_node/baseline")

        def wait(condition: Callable[[], object]) -> None:
            deadline = time.monotonic() + PATIENCE
            while not condition():
                processes.check()
                if time.monotonic() > deadline:
                    raise TimeoutError(f"last message of the model node: {heard[-1].message if heard else 'nothing'}")
                rclpy.spin_once(node, timeout_sec=0.1)

        wait(lambda: heard and heard[-1].hardware_id)
        pid = processes.ids["model_node"]
        rows = [("without a baseline", *_measured(pid, seconds))]
        answer = ask.call_async(Trigger.Request())
        wait(answer.done)
        heard.clear()
        wait(lambda: heard and all(word not in heard[-1].message for word in ("baseline;", "taking")))
        rows.append(("with a baseline", *_measured(pid, seconds)))
    more = rows[1][1] - rows[0][1]
    failures = () if more <= MOST else (f"the watch costs {more:.1f} % of a core, promised {MOST:g} %",)
    rows.append(("the watch alone", more, rows[1][2] - rows[0][2]))
    heads = ("model node at 50 kHz", "processor time, % of a core", "memory, MB")
    return Figures("Cost of the change watch", heads, rows, failures)


def _measured(pid: int, seconds: float) -> tuple[float, float]:
    begin, spent = time.monotonic(), processor_time(pid)
    time.sleep(seconds)
    return 100.0 * (processor_time(pid) - spent) / (time.monotonic() - begin), memory(pid)
