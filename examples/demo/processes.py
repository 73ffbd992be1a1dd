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

"""`Processes`: the nodes of the demo as separate processes. Each is ended by its id, however the demo ends."""

from __future__ import annotations

import ctypes
import os
import signal
import subprocess
from pathlib import Path
from types import TracebackType
from typing import Self

from ament_index_python.packages import get_package_prefix

PACKAGE = "piezo_hysteresis"
PATIENCE = 20.0
"""Time that a node gets to end by itself [s]; a driver ramps to its safe voltage first."""

_SET_PARENT_DEATH_SIGNAL = 1


def _end_with_parent() -> None:
    """If the demo is killed, the kernel sends SIGTERM to its nodes, and the stage goes to its safe voltage."""
    ctypes.CDLL(None).prctl(_SET_PARENT_DEATH_SIGNAL, signal.SIGTERM)


class Processes:
    """Node processes, started one by one and ended together, the last one first.

    Parameters
    ----------
    namespace : str
        Of all nodes.
    logs : pathlib.Path
        Folder for what they print.
    """

    def __init__(self, namespace: str, logs: Path) -> None:
        self._namespace, self._logs = namespace, logs
        self._running: dict[str, subprocess.Popen[bytes]] = {}

    def start(self, executable: str, **parameters: object) -> None:
        """Start an executable of the package; parameters are named with ``__`` for the dot."""
        program = Path(get_package_prefix(PACKAGE)) / "lib" / PACKAGE / executable
        command = [str(program), "--ros-args", "-r", f"__ns:={self._namespace}"]
        for name, value in parameters.items():
            command += ["-p", f"{name.replace('__', '.')}:={value}"]
        self._logs.mkdir(parents=True, exist_ok=True)
        with (self._logs / f"{executable}.log").open("wb") as log:
            self._running[executable] = subprocess.Popen(
                command,
                stdout=log,
                stderr=subprocess.STDOUT,
                start_new_session=True,  # Ctrl-C reaches the demo alone, which ends them in order
                preexec_fn=_end_with_parent,
                env=os.environ.copy(),
            )

    @property
    def ids(self) -> dict[str, int]:
        """Process id of every node."""
        return {name: process.pid for name, process in self._running.items()}

    def check(self) -> None:
        """Raise RuntimeError if a node has ended by itself."""
        for name, process in self._running.items():
            if process.poll() is not None:
                log = self._logs / f"{name}.log"
                raise RuntimeError(f"{name} ended with code {process.returncode}; the end of its log is in {log}")

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for process in reversed(self._running.values()):
            if process.poll() is None:
                process.send_signal(signal.SIGINT)
        for process in reversed(self._running.values()):
            try:
                process.wait(PATIENCE)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
