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

"""Runs `piezo` for the tests that call it as users do: in a process of its own, which may have a limited memory."""

import resource
import subprocess
import tempfile
import time
from functools import cache
from pathlib import Path

from .fork_server import ForkServer

SECONDS = 120
"""Processor time after which a call is ended [s]; none of them needs a tenth of it."""
INTERVAL = 0.01
"""Time between two checks of a call that runs [s]."""


@cache
def _server() -> ForkServer:
    commands = ("main", "model.diagnose", "model.identify", "model.validate", "recording.import_", "stage.simulate")
    return ForkServer(*(f"cli.{name}" for name in commands), "stage.simulated")


def piezo(*words: object, memory: int | None = None) -> subprocess.CompletedProcess[str]:
    """Call the command, with an address space of `memory` bytes at most."""
    command = [str(word) for word in words]
    limits = {resource.RLIMIT_CPU: SECONDS} | ({} if memory is None else {resource.RLIMIT_AS: memory})
    with tempfile.TemporaryDirectory() as folder:
        output = (Path(folder, "stdout"), Path(folder, "stderr"))
        server = _server()
        pid = server.start("piezo_hysteresis.cli.main:main", ["piezo", *command], output=output, limits=limits)
        while (status := server.poll(pid)) is None:
            time.sleep(INTERVAL)
        return subprocess.CompletedProcess(command, status, *(path.read_text(encoding="utf-8") for path in output))
