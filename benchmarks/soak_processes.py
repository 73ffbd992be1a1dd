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

"""`Soaked`: the processes of the soak; each can be killed, stopped and started again."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

from benchmarks.stage_log import StageLog

NAMESPACE = "/soak"


class Soaked:
    """A driver with a watched stage, a model node and a recorder.

    Parameters
    ----------
    folder : pathlib.Path
        For logs and recordings.
    log : StageLog
        Of the stage.
    parameters : mapping of str to mapping
        ROS parameters by process.
    """

    def __init__(self, folder: Path, log: StageLog, parameters: dict[str, dict[str, object]]) -> None:
        self.folder, self._parameters = folder, parameters
        module = [sys.executable, "-m"]
        self._programs = {
            "driver_node": log.driver,
            "model_node": [*module, "piezo_hysteresis.nodes.model.model_node"],
            "recorder": [*module, "benchmarks.soak_recorder"],
        }
        self._running: dict[str, subprocess.Popen[bytes]] = {}
        self.starts = dict.fromkeys(self._programs, 0)
        self.deaths: list[str] = []
        self._expected: set[int] = set()

    @property
    def recording(self) -> Path:
        """Folder of the bag of the present recorder."""
        return self.folder / f"bag_{self.starts['recorder']}"

    def start(self, name: str) -> None:
        """Start a process, for the first time or again."""
        self.starts[name] += 1
        command = [*self._programs[name], *([str(self.recording)] if name == "recorder" else [])]
        command += ["--ros-args", "-r", f"__ns:={NAMESPACE}"]
        for key, value in self._parameters.get(name, {}).items():
            command += ["-p", f"{key}:={value}"]
        with (self.folder / f"{name}.log").open("ab") as output:
            self._running[name] = subprocess.Popen(
                command, stdout=output, stderr=subprocess.STDOUT, start_new_session=True, env=os.environ.copy()
            )

    def refuses_second_driver(self) -> bool:
        """Whether a driver of the same topics gives up and says why."""
        command = [sys.executable, "-m", "piezo_hysteresis.nodes.driver.driver_node"]
        command += ["--ros-args", "-r", f"__ns:={NAMESPACE}"]
        log, deadline = self.folder / "second_driver.log", time.monotonic() + 30.0
        with log.open("wb") as output:
            process = subprocess.Popen(command, stdout=output, stderr=subprocess.STDOUT, env=os.environ.copy())
        try:
            while time.monotonic() < deadline:
                text = log.read_text(errors="replace")
                if "[ERROR]" in text or "active: samples flow" in text:
                    return "held by process" in text or "published by another driver" in text
                time.sleep(0.1)
            return False
        finally:
            process.kill()
            process.wait()

    def pid(self, name: str) -> int:
        """Process id."""
        return self._running[name].pid

    def send(self, name: str, number: signal.Signals) -> None:
        """Send a signal."""
        self._running[name].send_signal(number)

    def kill(self, name: str) -> None:
        """SIGKILL, and wait until it is gone."""
        process = self._running[name]
        self._expected.add(process.pid)
        process.kill()
        process.wait()

    @staticmethod
    def forget(bag: Path) -> None:
        """Delete a recording that has been looked at."""
        shutil.rmtree(bag)

    def check(self) -> None:
        """Note, and start again, what has ended by itself."""
        for name, process in list(self._running.items()):
            if process.poll() is not None and process.pid not in self._expected:
                self._expected.add(process.pid)
                self.deaths.append(f"{name} ended with code {process.returncode}: see {self.folder / name}.log")
                self.start(name)

    def memory(self, name: str) -> float:
        """Resident size [MB]; 0 for a process that is gone."""
        try:
            lines = Path(f"/proc/{self.pid(name)}/status").read_text().splitlines()
        except OSError:
            return 0.0
        return next((float(line.split()[1]) / 1024 for line in lines if line.startswith("VmRSS")), 0.0)

    def end(self) -> None:
        """End all of them in order, the driver last: it ramps to its safe voltage."""
        for name in ("recorder", "model_node", "driver_node"):
            process = self._running.get(name)
            if process is None or process.poll() is not None:
                continue
            process.send_signal(signal.SIGCONT)
            process.send_signal(signal.SIGINT)
            try:
                process.wait(20.0)
            except subprocess.TimeoutExpired:
                self.deaths.append(f"{name} did not end on SIGINT within 20 s")
                process.kill()
                process.wait()
