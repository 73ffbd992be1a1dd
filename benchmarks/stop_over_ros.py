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

"""Time from a call of `~/stop` over ROS until the voltage at the wire falls; the driver is a node process."""

from __future__ import annotations

import os
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import NamedTuple

import numpy as np
import rclpy
import yaml
from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.task import Future
from sensor_msgs.msg import PointCloud2
from std_srvs.srv import Trigger

from benchmarks.stage_log import StageLog
from benchmarks.wire import PERIOD, RAMP, SLEW, TOP, check_wire, device
from piezo_hysteresis.emulators.gcs2.controller import Controller, Reply
from piezo_hysteresis.nodes.messages.conversions import command_to_cloud, values_of
from piezo_hysteresis.nodes.runtime.qos import COMMAND, COMMAND_STATUS
from piezo_hysteresis.nodes.runtime.sending import is_taken_by

DRIVER = "driver_node"
PATIENCE = 20.0
"""Longest wait for anything [s]."""
FLOODED = 5
"""Commands that have come in and been refused before the stop."""
RISE = np.linspace(0.0, TOP, 6000)
"""From the safe voltage to the top [V]."""
TOPPED = np.full(20_000, TOP)
"""At the top [V]."""
FALLS = 0.02
"""Fall of the voltage that counts [V]."""


class StopTimes(NamedTuple):
    """From the request until the first lower voltage at the wire, and until the answer [s]."""

    fall: float
    answer: float


class StopBench:
    """A driver process of a back end, its stage at the end of the wire, and a node that asks it to stop.

    Parameters
    ----------
    word : str
        ``simulated``, ``memory``, ``gcs2`` or ``nidaqmx``.
    folder : Path
        For logs.
    """

    def __init__(self, word: str, folder: Path) -> None:
        self._word, self._opened = word, device(word)
        name, values, self._amplifier, emulated = self._opened.__enter__()
        self._heard = _heard(emulated[0]) if word == "gcs2" else []
        limits = {"voltage_min": 0.0, "voltage_max": TOP, "max_slew_rate": SLEW, "ramp_rate": RAMP}
        self._log = StageLog(folder / f"{word}.voltages", PERIOD, **limits)
        ours = {"stage": name, "sample_period": PERIOD, "keeper_timeout": 0.0, "discovery_time": 0.1}
        file = folder / f"{word}.yaml"
        given = {key: value for key, value in values.items() if value not in ("", ())}
        file.write_text(yaml.safe_dump({"/**": {"ros__parameters": ours | limits | {name: given}}}))
        self._environment = os.environ | {"ROS_LOG_DIR": str(folder)}
        self._namespace = f"/stop_{word}"
        command = [*self._log.driver, *self._ros, "--params-file", str(file)]
        self._messages = folder / f"{word}.log"
        with self._messages.open("wb") as log:
            self._driver = subprocess.Popen(command, env=self._environment, stdout=log, stderr=log)
        self._context = Context()
        rclpy.init(context=self._context)
        self._node = Node("asks", namespace=self._namespace, context=self._context)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self._node)
        self._ended = Future()
        self._thread = threading.Thread(target=self._executor.spin_until_future_complete, args=(self._ended,))
        self._thread.start()
        self._command = self._node.create_publisher(PointCloud2, "command", COMMAND)
        self.refusals = 0
        self._node.create_subscription(DiagnosticStatus, "command_status", self._count, COMMAND_STATUS)
        self._stop, self._release = (
            self._node.create_client(Trigger, f"{DRIVER}/{service}") for service in ("stop", "release")
        )
        self._wait(self._stop.service_is_ready)
        self._wait(lambda: is_taken_by(DRIVER, self._node, self._command))

    @property
    def _ros(self) -> list[str]:
        return ["--ros-args", "-r", f"__ns:={self._namespace}"]

    def _failure(self) -> str:
        """The last error that the driver has reported."""
        errors = [line for line in self._messages.read_text().splitlines() if line.startswith("[ERROR]")]
        return errors[-1].partition("]: ")[2] if errors else "the driver reported no error"

    def _count(self, status: DiagnosticStatus) -> None:
        self.refusals += values_of(status)["state"] == "refused"

    def _wait(self, condition: Callable[[], bool]) -> None:
        deadline = time.monotonic() + PATIENCE
        while not condition():
            if time.monotonic() > deadline or self._driver.poll() is not None:
                raise TimeoutError(f"{self._word}: waited for {PATIENCE:g} s; {self._failure()}")
            time.sleep(1e-3)

    def _output(self) -> float:
        """Voltage at the wire now [V]; of a stage that plays from memory, less the number of its runs."""
        if self._amplifier is not None:
            return self._amplifier.output
        if self._word == "memory":
            return -float(self._log.voltages.size)
        with Path(self._log.path).open("rb") as log:
            log.seek(-8, os.SEEK_END)
            return float(np.frombuffer(log.read())[0])

    def times(self, *, flooded: bool = False, transfer: str = "") -> StopTimes:
        """Stop the driver at the top of a waveform, or during a transfer, and let it be as it was.

        Parameters
        ----------
        flooded : bool
            Whether commands of 16 MB come in without a pause.
        transfer : str
            First letters of the lines of a GCS 2.0 transfer, ``WAV`` or ``DRR?``, in which the stop comes.
        """
        self._rise(bool(transfer))
        with self._flood() if flooded else nullcontext():
            if transfer:
                already = len(self._heard)
                self._send(TOPPED)
                self._wait(lambda: sum(line.startswith(transfer) for line in self._heard[already:]) > 1)
            times = self._stop_now()
        time.sleep(1.5 + TOP / RAMP)
        self._wait(self._release.call_async(Trigger.Request()).done)
        return times

    def _stop_now(self) -> StopTimes:
        answers: list[float] = []
        highest = now = self._output()
        begin = time.monotonic()
        asked = self._stop.call_async(Trigger.Request())
        asked.add_done_callback(lambda _: answers.append(time.monotonic() - begin))
        while now > highest - FALLS:
            highest = max(highest, now)
            time.sleep(1e-3)
            now = self._output()
            if time.monotonic() - begin > PATIENCE:
                raise TimeoutError(f"{self._word}: the voltage did not fall within {PATIENCE:g} s")
        fall = time.monotonic() - begin
        self._wait(lambda: bool(answers))
        return StopTimes(fall, answers[0])

    def _send(self, wave: np.ndarray) -> None:
        self._command.publish(command_to_cloud(wave, PERIOD, "wave"))

    def _rise(self, ends: bool) -> None:
        """Be at the top, by a waveform that has ended or that goes on for long."""
        deadline = time.monotonic() + PATIENCE
        while time.monotonic() < deadline:
            self._send(RISE if ends else np.concatenate((RISE, *[TOPPED] * 5)))
            time.sleep(1.5)
            if self._word == "memory" or self._output() > 0.9 * TOP:  # what is played from memory shows when it ends
                return
        raise TimeoutError(f"{self._word}: {TOP:g} V not reached within {PATIENCE:g} s; {self._failure()}")

    @contextmanager
    def _flood(self) -> Iterator[None]:
        command = [sys.executable, "-m", "benchmarks.command_flood", *self._ros]
        process = subprocess.Popen(command, env=self._environment)
        try:
            arrived = self.refusals + FLOODED
            self._wait(lambda: self.refusals >= arrived)
            yield
        finally:
            process.kill()
            process.wait()

    def end(self) -> None:
        """End the driver, and check what its stage was given."""
        self._driver.terminate()
        self._driver.wait(PATIENCE)
        self._ended.set_result(None)
        self._thread.join()
        self._node.destroy_node()
        rclpy.shutdown(context=self._context)
        self._opened.__exit__(None, None, None)
        if self._amplifier is None:
            self._log.check()
        else:
            check_wire(self._amplifier.wire)


def _heard(controller: Controller) -> list[str]:
    """The lines that an emulated controller receives from now on."""
    lines: list[str] = []
    carry_out = controller.carry_out

    def listening(line: str) -> Reply:
        lines.append(line)
        return carry_out(line)

    controller.carry_out = listening
    return lines
