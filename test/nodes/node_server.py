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

"""Starts the node processes of the tests: each is forked from one process that has imported what nodes import.

A node that starts spends a second of processor time on imports. Where a test is not about the start of a node, a fork
saves that second. Each node is still a process of its own, with its own environment, participant, log and exit status.
Tests of the start and of the exit status start a new interpreter.
"""

from __future__ import annotations

import atexit
import gc
import json
import os
import runpy
import signal
import subprocess
import sys
import threading
import time
import traceback
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import NoReturn

IMPORTED = (
    "nodes.driver.driver_node",
    "nodes.model.model_node",
    "nodes.identification.identification_node",
    "nodes.compensation.compensation_node",
    "stage.simulated",
)
"""Modules of the package that the server imports."""
INTERVAL = 0.01
"""Time between two looks at a process that is waited for [s]."""


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
        self.pid = _server().ask({"start": command, "environment": environment, "log": str(log), "folder": os.getcwd()})
        self.returncode: int | None = None

    def poll(self) -> int | None:
        """Exit status, negative for a signal; None while the process runs."""
        if self.returncode is None:
            self.returncode = _server().ask({"poll": self.pid})
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


class _Server:
    """The process that forks, and a lock: several threads of a test may ask."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._process = subprocess.Popen(
            [sys.executable, __file__], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )
        atexit.register(self._process.communicate)

    def ask(self, question: dict[str, object]) -> int | None:
        assert self._process.stdin is not None and self._process.stdout is not None
        with self._lock:
            self._process.stdin.write(json.dumps(question) + "\n")
            self._process.stdin.flush()
            return json.loads(self._process.stdout.readline())


@cache
def _server() -> _Server:
    return _Server()


def serve() -> None:
    """Answer every line of the standard input until it ends."""

    for name in IMPORTED:
        import_module(f"piezo_hysteresis.{name}")
    gc.freeze()  # otherwise every child would copy the memory that its garbage collector looks at
    for line in sys.stdin:
        question = json.loads(line)
        answer = _exit_status(question["poll"]) if "poll" in question else os.fork()
        if answer == 0 and "start" in question:
            _run(**question)
        sys.stdout.write(f"{json.dumps(answer)}\n")
        sys.stdout.flush()


def _exit_status(pid: int) -> int | None:
    ended, status = os.waitpid(pid, os.WNOHANG)
    return os.waitstatus_to_exitcode(status) if ended else None


def _run(start: list[str], environment: dict[str, str], log: str, folder: str) -> NoReturn:
    """What the executable of a node does, in a process that has imported it."""
    os.environ.clear()
    os.environ.update(environment)
    os.chdir(folder)
    os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
    output = os.open(log, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
    os.dup2(output, 1)
    os.dup2(output, 2)
    try:
        _call(start, environment)
    except SystemExit as end:
        status = end.code if isinstance(end.code, int) else 1
    except BaseException:
        traceback.print_exc()
        status = 1
    atexit._run_exitfuncs()
    sys.stdout.flush()
    os._exit(status)  # a library of ROS 2 would end a thread at exit that a fork does not have


def _call(start: list[str], environment: dict[str, str]) -> NoReturn:
    if start[0] == sys.executable:
        sys.argv = start[1:]
        sys.path[:0] = [str(Path(sys.argv[0]).parent), *environment.get("PYTHONPATH", "").split(os.pathsep)]
        runpy.run_path(sys.argv[0], run_name="__main__")
        sys.exit(0)
    from piezo_hysteresis.nodes import start as executables

    sys.argv = start
    sys.exit(getattr(executables, Path(start[0]).name)())


if __name__ == "__main__":
    serve()
