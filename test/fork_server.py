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

"""A process that imports modules of the package once and forks for every call, because an import takes a second.

Each call is still a process of its own, with its own memory, environment, streams and exit status. Run as a program,
this file is the server: its arguments are the modules, each line of its input is a question.
"""

from __future__ import annotations

import atexit
import gc
import json
import os
import resource
import runpy
import subprocess
import sys
import threading
import traceback
from importlib import import_module
from pathlib import Path
from typing import Any, NoReturn


class ForkServer:
    """The server as tests use it. Several threads of a test may ask.

    Parameters
    ----------
    *imported : str
        Modules of the package that every call needs.
    """

    def __init__(self, *imported: str) -> None:
        self._lock = threading.Lock()
        self._process = subprocess.Popen(
            [sys.executable, __file__, *imported],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env=os.environ | {"OPENBLAS_NUM_THREADS": "1"},  # a thread does not live on in a fork
        )
        atexit.register(self._process.communicate)

    def start(
        self,
        program: str,
        arguments: list[str],
        *,
        output: tuple[Path, Path],
        environment: dict[str, str] | None = None,
        limits: dict[int, int] | None = None,
    ) -> int:
        """Start a process in the present folder.

        Parameters
        ----------
        program : str
            A function without arguments, as ``module:function``, or the file of a Python program.
        arguments : list of str
            For its `sys.argv`, with its name.
        output : tuple of pathlib.Path
            Files for what it writes and for its errors.
        environment : dict, optional
            All its variables; those of the server by default.
        limits : dict, optional
            Largest values of what `resource.setrlimit` names.

        Returns
        -------
        int
            Number of the process.
        """
        streams = [str(path) for path in output]
        return int(
            self._ask("start", program, arguments, streams, os.getcwd(), environment, list((limits or {}).items()))
        )

    def poll(self, pid: int) -> int | None:
        """Exit status, negative for a signal, given once; None while the process runs."""
        return self._ask("poll", pid)

    def _ask(self, *question: object) -> Any:
        assert self._process.stdin is not None and self._process.stdout is not None
        with self._lock:
            self._process.stdin.write(json.dumps(question) + "\n")
            self._process.stdin.flush()
            return json.loads(self._process.stdout.readline())


def _serve(imported: list[str]) -> None:
    for name in imported:
        import_module(f"piezo_hysteresis.{name}")
    gc.freeze()  # otherwise every child would copy the memory that its garbage collector looks at
    for line in sys.stdin:
        kind, *question = json.loads(line)
        answer = _exit_status(*question) if kind == "poll" else os.fork()
        if answer == 0 and kind == "start":
            _run(*question)
        sys.stdout.write(f"{json.dumps(answer)}\n")
        sys.stdout.flush()


def _exit_status(pid: int) -> int | None:
    ended, status = os.waitpid(pid, os.WNOHANG)
    return os.waitstatus_to_exitcode(status) if ended else None


def _run(
    program: str,
    arguments: list[str],
    streams: list[str],
    folder: str,
    environment: dict[str, str] | None,
    limits: list[tuple[int, int]],
) -> NoReturn:
    """What an interpreter does with the program, in a process that has imported the package."""
    if environment is not None:
        os.environ.clear()
        os.environ.update(environment)
    os.chdir(folder)
    os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
    for number, path in enumerate(streams, 1):
        os.dup2(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC | os.O_APPEND), number)
    for kind, most in limits:
        resource.setrlimit(kind, (most, most))
    sys.argv = arguments
    try:
        sys.exit(_call(program))
    except SystemExit as end:
        if isinstance(end.code, str):
            sys.stderr.write(f"{end.code}\n")
        status = end.code if isinstance(end.code, int) else int(end.code is not None)
    except BaseException:
        traceback.print_exc()
        status = 1
    atexit._run_exitfuncs()
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(status)  # a library of ROS 2 would end a thread at exit that a fork does not have


def _call(program: str) -> object:
    if program.endswith(".py"):
        sys.path[:0] = [str(Path(program).parent), *os.environ.get("PYTHONPATH", "").split(os.pathsep)]
        runpy.run_path(program, run_name="__main__")
        return None
    module, _, function = program.partition(":")
    return getattr(import_module(module), function)()


if __name__ == "__main__":
    _serve(sys.argv[1:])
