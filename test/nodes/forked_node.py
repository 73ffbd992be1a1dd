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

"""Node processes of tests, each forked from one process that has imported what nodes import.

Tests of the start and of the exit status start a new interpreter instead.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from functools import cache
from pathlib import Path

from ..fork_server import ForkServer

INTERVAL = 0.01
"""Time between two looks at a process that is waited for [s]."""


@cache
def _server() -> ForkServer:
    nodes = ("driver.driver", "model.model", "several_axes.axes_model", "identification.identification")
    return ForkServer(*(f"nodes.{name}_node" for name in (*nodes, "compensation.compensation")), "stage.simulated")


class ForkedNode:
    """A node process, with what the tests use of `subprocess.Popen`.

    Parameters
    ----------
    command : list of str
        An executable of `piezo_hysteresis.nodes.start`, or Python and a program, and the arguments.
    environment : dict
        All variables of the process.
    log : pathlib.Path
        For its output.
    """

    def __init__(self, command: list[str], environment: dict[str, str], log: Path) -> None:
        self.args = command
        if command[0] == sys.executable:
            program, arguments = command[1], command[1:]
        else:
            program, arguments = f"piezo_hysteresis.nodes.start:{Path(command[0]).name}", command
        self.pid = _server().start(program, arguments, output=(log, log), environment=environment)
        self.returncode: int | None = None

    def poll(self) -> int | None:
        """Exit status, negative for a signal; None while the process runs."""
        if self.returncode is None:
            self.returncode = _server().poll(self.pid)
        return self.returncode

    def wait(self, timeout: float) -> int:
        """Exit status, once the process has ended."""
        deadline = time.monotonic() + timeout
        while (status := self.poll()) is None:
            if time.monotonic() > deadline:
                raise subprocess.TimeoutExpired(self.args, timeout)
            time.sleep(INTERVAL)
        return status

    def send_signal(self, number: signal.Signals) -> None:
        """Send a signal, if the process runs."""
        if self.poll() is None:
            os.kill(self.pid, number)

    def kill(self) -> None:
        """End the process at once."""
        self.send_signal(signal.SIGKILL)
