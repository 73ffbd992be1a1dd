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

"""Runs `piezo` for the tests that call it as users do: in a process of its own, which may have a limited memory.

A new interpreter spends a second on imports. One server process imports the package once and forks for every call, so
that each call still has its own process, its own memory and its own exit status.
"""

import atexit
import gc
import json
import os
import resource
import subprocess
import sys
import tempfile
from functools import cache
from importlib import import_module
from pathlib import Path

SECONDS = 120
"""Time after which a call is ended [s]; none of them needs a tenth of it."""
IMPORTED = (
    "cli.main",
    "cli.diagnose",
    "cli.identify",
    "cli.import_",
    "cli.simulate",
    "cli.validate",
    "stage.simulated",
)
"""Modules of the package that the server imports."""


def piezo(*words: object, memory: int | None = None) -> subprocess.CompletedProcess[str]:
    """Call the command, with an address space of `memory` bytes at most."""
    server = _server()
    with tempfile.TemporaryDirectory() as folder:
        streams = [str(Path(folder, name)) for name in ("stdout", "stderr")]
        command = [str(word) for word in words]
        server.stdin.write(json.dumps([command, streams, memory, os.getcwd()]) + "\n")
        server.stdin.flush()
        status = int(server.stdout.readline())
        return subprocess.CompletedProcess(command, status, *(Path(s).read_text(encoding="utf-8") for s in streams))


@cache
def _server() -> subprocess.Popen[str]:
    process = subprocess.Popen(
        [sys.executable, __file__],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        env=os.environ | {"OPENBLAS_NUM_THREADS": "1"},
    )

    def end() -> None:
        process.communicate()

    atexit.register(end)
    return process


def serve() -> None:
    """Answer every line of the standard input with the exit status of a call, until the input ends."""
    for name in IMPORTED:
        import_module(f"piezo_hysteresis.{name}")
    gc.freeze()  # otherwise every child would copy the memory that its garbage collector looks at
    for line in sys.stdin:
        words, streams, memory, folder = json.loads(line)
        child = os.fork()
        if child == 0:
            _run(words, streams, memory, folder)
        _, status = os.waitpid(child, 0)
        sys.stdout.write(f"{os.waitstatus_to_exitcode(status)}\n")
        sys.stdout.flush()


def _run(words: list[str], streams: list[str], memory: int | None, folder: str) -> None:
    """What ``if __name__ == "__main__"`` of the command does, with other streams."""
    os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
    for number, path in enumerate(streams, 1):
        os.dup2(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC), number)
    os.chdir(folder)
    resource.setrlimit(resource.RLIMIT_CPU, (SECONDS, SECONDS))
    if memory is not None:
        resource.setrlimit(resource.RLIMIT_AS, (memory, memory))
    from piezo_hysteresis.cli.main import main

    sys.exit(main(words))


if __name__ == "__main__":
    serve()
